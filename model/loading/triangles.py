"""Polygons to triangles, and pieces and parts of a file to one list of triangles."""

from collections.abc import Iterable

import numpy as np
from numpy.typing import NDArray

from meshconv3d.model.errors import MalformedFile
from meshconv3d.model.loading.limits import Limits

# Vertices V x 3 and triangles F x 3. What is wrong with them is for Mesh to say, so an index that
# names no vertex is kept, never wrapped.
Triangles = tuple[NDArray[np.float64], NDArray[np.int64]]


class Pieces:
    """Vertices and triangles of a file that is read piece by piece, counted as they come."""

    def __init__(self, limits: Limits) -> None:
        self._limits = limits
        self._vertices: list[NDArray[np.float64]] = [np.empty((0, 3))]
        self._faces: list[NDArray[np.int64]] = [np.empty((0, 3), dtype=np.int64)]
        self.vertex_count = 0
        self._face_count = 0

    def add(self, vertices: NDArray[np.float64], faces: NDArray[np.int64]) -> None:
        """Raises LimitExceeded when there are now too many."""
        self.vertex_count += len(vertices)
        self._face_count += len(faces)
        self._limits.check("faces", self._face_count)
        self._limits.check("vertices", self.vertex_count)
        self._vertices.append(vertices)
        self._faces.append(faces)

    def joined(self) -> Triangles:
        """All of them, as they came."""
        return np.concatenate(self._vertices), np.concatenate(self._faces)


def fan(corners: NDArray, counts: NDArray[np.int64], limits: Limits) -> NDArray[np.int64]:
    """Triangles (F x 3) of polygons, each a fan around its first corner; the order is kept.

    corners: vertex indices of all polygons one after another, sum(counts).
    counts: corners of each polygon. One with fewer than three has no triangle.

    Raises LimitExceeded when there are too many, MalformedFile when corners are no whole numbers.
    """
    if len(counts) and (counts == 3).all():
        limits.check("faces", len(counts))
        return indices(corners).reshape(-1, 3)
    triangles = np.maximum(counts - 2, 0)
    limits.check("faces", int(triangles.sum()))
    first = np.repeat(np.cumsum(counts) - counts, triangles)
    step = np.arange(triangles.sum()) - np.repeat(np.cumsum(triangles) - triangles, triangles)
    return indices(corners)[np.stack([first, first + step + 1, first + step + 2], axis=1)]


def coordinates(values: NDArray) -> NDArray[np.float64]:
    """Numbers of any type as float64."""
    with np.errstate(invalid="ignore"):  # some bits of a float32 are a NaN that warns
        return values.astype(np.float64)


def indices(values: NDArray) -> NDArray[np.int64]:
    """Numbers as vertex indices. Raises MalformedFile when they are not whole numbers."""
    if np.issubdtype(values.dtype, np.integer):
        return values.astype(np.int64)
    values = coordinates(values)
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
