"""Subdivision of a mesh with too few faces: longest edges are split at their middle."""

import heapq

import numpy as np
from numpy.typing import NDArray

from meshconv3d.model.jit import kernel
from meshconv3d.model.topology.halfedges import find_twins


def subdivide(
    vertices: NDArray[np.float64], faces: NDArray[np.int32], budget: int
) -> tuple[NDArray[np.float64], NDArray[np.int32]]:
    """Split longest edges at their middle, from below, to `budget` faces or one less.

    A mesh that has as many, or more, stays as it is. The surface stays where it is: an inner edge
    splits two faces, a border edge one.
    """
    twin, _, _ = find_twins(faces, len(vertices))
    room = max(budget - len(faces), 0)
    split_vertices = np.concatenate([vertices, np.empty((room, 3))])
    split_faces = np.concatenate([faces, np.empty((room, 3), np.int32)])
    split_twin = np.concatenate([twin, np.full(3 * room, -1, np.int32)])
    vertex_count, face_count = _bisect(
        split_vertices, split_faces, split_twin, len(vertices), len(faces)
    )
    return split_vertices[:vertex_count], split_faces[:face_count]


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
