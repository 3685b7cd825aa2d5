"""MeshCNN's engraved cubes, regenerated from the silhouettes that they were made of.

The silhouettes are those of MPEG-7 CE-Shape-1 part B, and the recipe is the published one:

    1. the longest outer contour of a silhouette, simplified at 0.001 of its perimeter and scaled
       to a long side of 1 (`silhouettes`);
    2. turned at random and shifted by up to 0.9 along both axes of one face of a cube of side 3,
       and engraved there 0.1 deep (`engraving`);
    3. meshed with exactly 500 triangles (`meshing`);
    4. the cube turned at random;
    5. 17 silhouettes of each class to train on and 3 to test on, 10 cubes each (`generation`).

Where the recipe is silent: the cube's rotation is uniformly random; an engraving that would reach
over the edge of its face is placed anew; the few outlines too intricate for 500 triangles are
simplified further; the rest of the triangles goes to the flat sides, so that nothing that the
outline still has is simplified away. Which silhouettes the original tests on is not known.
"Regenerated cubes", then: figures on the two are not comparable digit for digit.
"""
