"""More triangles on a solid of flat sides, without moving its surface.

Quadric simplification from a finer mesh folds triangles over on exact planes, where every collapse
costs nothing; splitting edges of the plainest mesh cannot.
"""

from collections.abc import Iterable

import numpy as np
from numpy.typing import NDArray

from meshconv3d.model.jit import kernel
from meshconv3d.model.preparation.subdivision import subdivide
from meshconv3d.model.topology.halfedges import find_twins

# How often triangles are made Delaunay on the way: the splits then spread over the sides, instead
# of cutting the long triangles that reach from an engraving to the cube's corners into pieces.
ROUNDS = 4

# (axis, coordinate) of a plane.
Plane = tuple[int, float]


def refine(
    vertices: NDArray[np.float64],
    faces: NDArray[np.int32],
    count: int,
    planes: Iterable[Plane],
) -> tuple[NDArray[np.float64], NDArray[np.int32]]:
    """A closed mesh (V x 3, F x 3, F at most `count`) with exactly `count` faces, an even number.

    Longest edges are split at their middle, and the triangles on each of the planes kept
    Delaunay among themselves. A mesh that has more faces keeps their number.
    """
    planes = list(planes)
    faces = _delaunay(vertices, faces, planes)
    # Halves: a closed mesh has an even number of faces.
    for half in np.linspace(len(faces) / 2, count / 2, ROUNDS + 1)[1:]:
        vertices, faces = subdivide(vertices, faces, 2 * int(half))
        faces = _delaunay(vertices, faces, planes)
    return vertices, faces


def _delaunay(
    vertices: NDArray[np.float64], faces: NDArray[np.int32], planes: list[Plane]
) -> NDArray[np.int32]:
    """The faces after edges were flipped within each plane."""
    side = np.full(len(faces), -1, np.int32)
    for index, (axis, coordinate) in enumerate(planes):
        side[(vertices[faces][:, :, axis] == coordinate).all(axis=1)] = index
    twin, _, _ = find_twins(faces, len(vertices))
    faces = faces.copy()
    _flip_edges(vertices, faces, twin, side)
    return faces


@kernel
def _flip_edges(
    vertices: NDArray[np.float64],
    faces: NDArray[np.int32],
    twin: NDArray[np.int32],
    side: NDArray[np.int32],
) -> None:
    """Lawson's flips, in place, of edges between two faces of one flat side (F, or -1 for none)."""
    queue = [h for h in range(3 * len(faces))]  # noqa: C416 (numba)
    while len(queue) > 0:
        h = queue.pop()
        t = twin[h]
        f, g = h // 3, t // 3
        if side[f] < 0 or side[f] != side[g]:
            continue
        before, after = 3 * f + (h + 2) % 3, 3 * f + (h + 1) % 3
        opposite_before, opposite_after = 3 * g + (t + 2) % 3, 3 * g + (t + 1) % 3
        start, end = faces[f, h % 3], faces[g, t % 3]
        left, right = faces[f, before % 3], faces[g, opposite_before % 3]
        if not _is_too_wide(vertices, start, end, left, right):
            continue
        outer = (twin[before], twin[opposite_after], twin[opposite_before], twin[after])
        faces[f, 0], faces[f, 1], faces[f, 2] = left, start, right
        faces[g, 0], faces[g, 1], faces[g, 2] = right, end, left
        _pair(twin, 3 * f + 2, 3 * g + 2)
        for place, other in zip((3 * f, 3 * f + 1, 3 * g, 3 * g + 1), outer):  # noqa: B905 (numba)
            _pair(twin, place, other)
            queue.append(place)


@kernel
def _pair(twin: NDArray[np.int32], h: int, other: int) -> None:
    twin[h] = other
    twin[other] = h


@kernel
def _is_too_wide(
    vertices: NDArray[np.float64], start: int, end: int, left: int, right: int
) -> bool:
    """Whether the angles at both sides of an edge add up to more than half a turn.

    Clearly more: of four points on a circle, both diagonals would be flipped for ever.
    """
    cosine_left, sine_left = _angle(vertices, left, start, end)
    cosine_right, sine_right = _angle(vertices, right, start, end)
    return sine_left * cosine_right + cosine_left * sine_right < -1e-9


@kernel
def _angle(vertices: NDArray[np.float64], corner: int, one: int, other: int) -> tuple[float, float]:
    """Cosine and sine of the angle at a corner."""
    u, v = vertices[one] - vertices[corner], vertices[other] - vertices[corner]
    lengths = np.sqrt((u * u).sum() * (v * v).sum())
    cross = np.cross(u, v)
    return (u * v).sum() / lengths, np.sqrt((cross * cross).sum()) / lengths
