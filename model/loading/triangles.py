"""Polygons to triangles, and parts of a scene to one list of triangles."""

from collections.abc import Iterable

import numpy as np
from numpy.typing import NDArray

from model.errors import MalformedFile

# Vertices V x 3 and triangles F x 3. What is wrong with them is for Mesh to say, so an index that
# names no vertex is kept, never wrapped.
Triangles = tuple[NDArray[np.float64], NDArray[np.int64]]


def fan(corners: NDArray[np.int64], counts: NDArray[np.int64]) -> NDArray[np.int64]:
    """Triangles (F x 3) of polygons, each a fan around its first corner; the order is kept.

    corners: vertex indices of all polygons one after another, sum(counts).
    counts: corners of each polygon. One with fewer than three has no triangle.
    """
    if len(counts) and (counts == 3).all():
        return corners.reshape(-1, 3)
    triangles = np.maximum(counts - 2, 0)
    first = np.repeat(np.cumsum(counts) - counts, triangles)
    step = np.arange(triangles.sum()) - np.repeat(np.cumsum(triangles) - triangles, triangles)
    return corners[np.stack([first, first + step + 1, first + step + 2], axis=1)]


def indices(values: NDArray) -> NDArray[np.int64]:
    """Numbers as vertex indices. Raises MalformedFile when they are not whole numbers."""
    if np.issubdtype(values.dtype, np.integer):
        return values.astype(np.int64)
    if not (np.abs(values) < 2**53).all() or (values != np.trunc(values)).any():
        raise MalformedFile(
            "bad-index", "a face names its vertices by something else than whole numbers"
        )
    return values.astype(np.int64)


def join(parts: Iterable[Triangles]) -> Triangles:
    """One list of triangles from the parts of a scene."""
    vertices: list[NDArray[np.float64]] = [np.empty((0, 3))]
    faces: list[NDArray[np.int64]] = [np.empty((0, 3), dtype=np.int64)]
    offset = 0
    for part_vertices, part_faces in parts:
        # A bad index must stay bad, not name a vertex of the part before or after.
        outside = (part_faces < 0) | (part_faces >= len(part_vertices))
        vertices.append(part_vertices)
        faces.append(np.where(outside, -1, part_faces + offset))
        offset += len(part_vertices)
    return np.concatenate(vertices), np.concatenate(faces)
