"""Subdivision of a mesh with too few faces: longest edges are split at their middle.

Flat parts are triangulated anew before, so that the result depends on the surface, and not on how
a file or a reader has cut its polygons.
"""

import heapq

import numpy as np
from numpy.typing import NDArray

from meshconv3d.model.jit import kernel
from meshconv3d.model.topology.geometry import cross, dot, length, row, subtract
from meshconv3d.model.topology.halfedges import find_twins

# Of the angle between the normals of two faces that are flat together, its cosine below 1.
FLAT = 1e-6
# Of the sine of an angle: what is left to rounding.
ROUNDING = 1e-9


def subdivide(
    vertices: NDArray[np.float64], faces: NDArray[np.int32], budget: int
) -> tuple[NDArray[np.float64], NDArray[np.int32]]:
    """Split longest edges at their middle, from below, to `budget` faces or one less.

    A mesh that has as many, or more, stays as it is. The surface stays where it is: an inner edge
    splits two faces, a border edge one. Vertices stay the first.
    """
    room = budget - len(faces)
    if room <= 0:
        return vertices, faces
    faces = faces.copy()
    flip_flat_edges(vertices, faces, find_twins(faces, len(vertices))[0])
    # In an order of their own: each from its first vertex on, and by its corners.
    first = faces.argmin(axis=1)[:, None]
    faces = np.take_along_axis(faces, (first + np.arange(3)) % 3, axis=1)
    faces = faces[np.lexsort(faces.T[::-1])]
    twin, _, _ = find_twins(faces, len(vertices))
    split_vertices = np.concatenate([vertices, np.empty((room, 3))])
    split_faces = np.concatenate([faces, np.empty((room, 3), np.int32)])
    split_twin = np.concatenate([twin, np.full(3 * room, -1, np.int32)])
    vertex_count, face_count = _bisect(
        split_vertices, split_faces, split_twin, len(vertices), len(faces)
    )
    return split_vertices[:vertex_count], split_faces[:face_count]


@kernel
def flip_flat_edges(
    vertices: NDArray[np.float64], faces: NDArray[np.int32], twin: NDArray[np.int32]
) -> None:
    """Make the flat parts of an oriented manifold Delaunay, in place.

    An edge of two faces of one plane becomes the other diagonal of their quadrilateral where the
    angles across from it are more than 180 degrees together. Rectangles keep the diagonal that they
    have: it is the longest edge, and split at the same point.
    """
    for _ in range(len(faces)):
        flips = 0
        for h in range(len(twin)):
            if twin[h] > h and _is_to_flip(vertices, faces, h, twin[h]):
                _flip(faces, twin, h, twin[h])
                flips += 1
        if flips == 0:
            break


@kernel
def _is_to_flip(vertices: NDArray[np.float64], faces: NDArray[np.int32], h: int, t: int) -> bool:
    a, b, c = _corners(faces, h)
    start, _, d = _corners(faces, t)
    if start != b or c == d or _is_edge(faces, c, d):
        return False
    pa, pb, pc, pd = row(vertices, a), row(vertices, b), row(vertices, c), row(vertices, d)
    ca, cb, da, db = subtract(pa, pc), subtract(pb, pc), subtract(pa, pd), subtract(pb, pd)
    one, other = cross(ca, cb), cross(db, da)
    if dot(one, other) < (1 - FLAT) * length(one) * length(other):
        return False
    # Sine of the sum of the angles at c and d, times the lengths of their sides.
    sine = length(one) * dot(da, db) + length(other) * dot(ca, cb)
    return sine < -ROUNDING * length(ca) * length(cb) * length(da) * length(db)


@kernel
def _corners(faces: NDArray[np.int32], h: int) -> tuple[int, int, int]:
    """Start and end of a half-edge, and the corner across."""
    f, s = h // 3, h % 3
    return faces[f, s], faces[f, (s + 1) % 3], faces[f, (s + 2) % 3]


@kernel
def _is_edge(faces: NDArray[np.int32], c: int, d: int) -> bool:
    for f in range(len(faces)):
        for s in range(3):
            a, b = faces[f, s], faces[f, (s + 1) % 3]
            if (a == c and b == d) or (a == d and b == c):
                return True
    return False


@kernel
def _flip(faces: NDArray[np.int32], twin: NDArray[np.int32], h: int, t: int) -> None:
    """Replace the edge of half-edges h and t by the other diagonal of its two faces."""
    a, b, c = _corners(faces, h)
    _, _, d = _corners(faces, t)
    f, g = h // 3, t // 3
    after, before = twin[3 * f + (h + 1) % 3], twin[3 * f + (h + 2) % 3]
    after_twin, before_twin = twin[3 * g + (t + 1) % 3], twin[3 * g + (t + 2) % 3]
    faces[f, 0], faces[f, 1], faces[f, 2] = d, c, a
    faces[g, 0], faces[g, 1], faces[g, 2] = c, d, b
    _pair(twin, 3 * f, 3 * g)
    _pair(twin, 3 * f + 1, before)
    _pair(twin, 3 * f + 2, after_twin)
    _pair(twin, 3 * g + 1, before_twin)
    _pair(twin, 3 * g + 2, after)


@kernel
def _bisect(
    vertices: NDArray[np.float64],
    faces: NDArray[np.int32],
    twin: NDArray[np.int32],
    vertex_count: int,
    face_count: int,
) -> tuple[int, int]:
    """Bisect longest edges in place while an inner edge's two new faces have room.

    Returns the new (vertex_count, face_count); rows behind them are unused.
    """
    heap = [(-_length(vertices, faces, h), h) for h in range(3 * face_count)]
    heapq.heapify(heap)
    while face_count + 2 <= len(faces):
        negative_length, h = heapq.heappop(heap)
        if -negative_length != _length(vertices, faces, h):
            continue  # this side has been split since it was queued
        t = twin[h]
        start, end = faces[h // 3, h % 3], faces[h // 3, (h % 3 + 1) % 3]
        middle = vertex_count
        vertices[middle] = (vertices[start] + vertices[end]) / 2
        vertex_count += 1
        far = _split_face(vertices, faces, twin, h, middle, face_count, heap)
        face_count += 1
        if t >= 0:
            alike = faces[t // 3, t % 3] == start
            far_twin = _split_face(vertices, faces, twin, t, middle, face_count, heap)
            face_count += 1
            _pair(twin, h, t if alike else far_twin)
            _pair(twin, far, far_twin if alike else t)
    return vertex_count, face_count


@kernel
def _split_face(
    vertices: NDArray[np.float64],
    faces: NDArray[np.int32],
    twin: NDArray[np.int32],
    h: int,
    middle: int,
    new: int,
    heap: list,
) -> int:
    """Cut h's face from the middle of h to the corner across; the far half is face `new`.

    h keeps the near half of the edge; returns the half-edge of the far one. Neither has a twin
    yet. Queues the sides of both faces.
    """
    f, s = h // 3, h % 3
    after, before = (s + 1) % 3, (s + 2) % 3
    faces[new, 0] = middle
    faces[new, 1] = faces[f, after]
    faces[new, 2] = faces[f, before]
    faces[f, after] = middle
    _pair(twin, 3 * new + 1, twin[3 * f + after])
    _pair(twin, 3 * new + 2, 3 * f + after)
    twin[h] = -1
    for side in range(3):
        heapq.heappush(heap, (-_length(vertices, faces, 3 * f + side), 3 * f + side))
        heapq.heappush(heap, (-_length(vertices, faces, 3 * new + side), 3 * new + side))
    return 3 * new


@kernel
def _pair(twin: NDArray[np.int32], h: int, other: int) -> None:
    twin[h] = other
    if other >= 0:
        twin[other] = h


@kernel
def _length(vertices: NDArray[np.float64], faces: NDArray[np.int32], h: int) -> float:
    """Squared length of a half-edge, to seven digits.

    The halves of a split edge are equally long; in full precision, rounding would tell them
    apart, and a mesh that was moved would be split elsewhere.
    """
    a, b = faces[h // 3, h % 3], faces[h // 3, (h % 3 + 1) % 3]
    square = 0.0
    for k in range(3):
        square += (vertices[a, k] - vertices[b, k]) ** 2
    return np.float64(np.float32(square))
