"""A cube with an outline engraved on one face."""

from contextlib import suppress

import numpy as np
from manifold3d import CrossSection, Error, Manifold, Mesh64
from numpy.typing import NDArray
from shapely import Polygon

from benchmarks.cubes.meshing import Plane, refine
from benchmarks.cubes.recipe import CubesError
from meshconv3d.model.mesh import Mesh
from meshconv3d.model.training.augmentation import random_rotation

SIDE = 3.0
DEPTH = 0.1
SHIFT = 0.9  # at most, along either axis of the face
MARGIN = 0.05  # left between an engraving and the edge of the face
FACES = 500
# That are tried: where corners come too near to each other, a few more faces are cut than there are
# to be, by some turns and not by others.
PLACES = 5

# A plain cube has 12 faces; a corner of the outline adds two of the wall, one of the floor and one
# of the face around it.
MOST_CORNERS = (FACES - 12) // 4

# Corners, N x 2, counter-clockwise.
Outline = NDArray[np.float64]

TOP = SIDE / 2
FLOOR = TOP - DEPTH
PLANES: list[Plane] = [*((axis, side) for axis in range(3) for side in (-TOP, TOP)), (2, FLOOR)]


def engraved_cube(outline: Outline, rng: np.random.Generator) -> Mesh:
    """A closed mesh of FACES faces, wound outward: the outline somewhere on a face of a cube
    of side SIDE around the origin, DEPTH deep, all turned at random.

    outline: about the origin, with a long side of 1 and at most MOST_CORNERS corners. Raises
    CubesError where the mesh came out as anything else, wherever the outline was put.
    """
    for _ in range(PLACES - 1):
        with suppress(CubesError):
            return _engraved_somewhere(outline, rng)
    return _engraved_somewhere(outline, rng)


def _engraved_somewhere(outline: Outline, rng: np.random.Generator) -> Mesh:
    vertices, faces = engrave(place(outline, rng))
    return Mesh(vertices @ random_rotation(rng).T, faces)


def place(outline: Outline, rng: np.random.Generator) -> Outline:
    """The outline turned about its middle, then shifted; again, until it lies within the face."""
    while True:
        angle = rng.uniform(0, 2 * np.pi)
        cosine, sine = np.cos(angle), np.sin(angle)
        turned = outline @ np.array([[cosine, sine], [-sine, cosine]])
        placed = turned + rng.uniform(-SHIFT, SHIFT, 2)
        if np.abs(placed).max() <= TOP - MARGIN:
            return placed


def engrave(outline: Outline) -> tuple[NDArray[np.float64], NDArray[np.int32]]:
    """The cube, not turned, with the outline in its face z = SIDE / 2: vertices V x 3, faces
    FACES x 3. Raises CubesError."""
    # Half of the tool sticks out of the cube: nothing may be left of the face above the floor.
    tool = CrossSection([outline]).extrude(2 * DEPTH).translate((0, 0, FLOOR))
    solid = Manifold.cube((SIDE, SIDE, SIDE), center=True) - tool
    if solid.status() != Error.NoError:
        raise CubesError(f"the outline cannot be engraved ({solid.status().name})")
    mesh = solid.to_mesh64()
    vertices = np.array(mesh.vert_properties)[:, :3]
    faces = np.array(mesh.tri_verts, dtype=np.int32)
    vertices, faces = refine(vertices, faces, FACES, PLANES)
    shape = Polygon(outline)
    _check(vertices, faces, SIDE**3 - DEPTH * shape.area, 6 * SIDE**2 + DEPTH * shape.length)
    return vertices, faces


def _check(
    vertices: NDArray[np.float64], faces: NDArray[np.int32], volume: float, area: float
) -> None:
    """Raise CubesError unless this is one sphere of FACES faces, with this volume and area."""
    if len(faces) != FACES:
        raise CubesError(f"the engraved cube has {len(faces)} faces, not {FACES}")
    solid = Manifold(Mesh64(vertices, faces.astype(np.uint64)))
    # Euler: a closed surface of F faces without handles or pinches has F / 2 + 2 vertices.
    whole = solid.status() == Error.NoError and solid.num_vert() == len(vertices) == FACES // 2 + 2
    if not whole:
        raise CubesError(f"the engraved cube is no closed manifold ({solid.status().name})")
    # Triangles that are folded over change the area alone. Outlines are cut to eight decimals.
    found = solid.volume(), solid.surface_area()
    if not np.allclose(found, (volume, area), rtol=0, atol=1e-6):
        raise CubesError(
            f"the engraved cube has volume and area {found}, expected {volume} and {area}"
        )
