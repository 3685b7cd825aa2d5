"""K-face patches: the neighbourhood that one convolution sees (paper, section III.B)."""

import numpy as np
from numpy.typing import NDArray

from meshconv3d.model.jit import kernel


@kernel
def grow_patches(adjacency: NDArray[np.int32], patch_size: int) -> NDArray[np.int32]:
    """Walk the sorted adjacency breadth first from every face until K faces are found.

    adjacency: F x 3 int32 of face + 1, 0 for none, as `sort_adjacency` returns it.
    patch_size: K >= 1, counting the face itself.
    Returns F x K int32 of face + 1: the face, its neighbours, then the unseen neighbours of
    each in turn; 0, the null face, where the component has fewer than K faces.
    """
    faces = len(adjacency)
    patches = np.zeros((faces, patch_size), np.int32)
    seen_by = np.full(faces + 1, -1, np.int32)
    for f in range(faces):
        patches[f, 0] = f + 1
        seen_by[f + 1] = f
        found = 1
        visited = 0
        while visited < found < patch_size:
            g = patches[f, visited] - 1
            for slot in range(3):
                neighbour = adjacency[g, slot]
                if neighbour > 0 and seen_by[neighbour] != f and found < patch_size:
                    patches[f, found] = neighbour
                    seen_by[neighbour] = f
                    found += 1
            visited += 1
    return patches
