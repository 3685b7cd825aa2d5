"""Scenes: parts that are placed, each maybe many times, to one list of triangles."""

from collections.abc import Sequence
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from meshconv3d.model.loading.limits import Limits
from meshconv3d.model.loading.triangles import Triangles, join

Matrix = NDArray[np.float64]  # 4 x 4, of column vectors


class Part(Protocol):
    """Something with triangles, whose size is known before it is read."""

    @property
    def vertex_count(self) -> int: ...

    @property
    def face_count(self) -> int: ...

    def read(self) -> Triangles: ...


def flatten(placed: Sequence[tuple[Part, Matrix]], limits: Limits) -> Triangles:
    """All parts where their matrices place them. Raises LimitExceeded before any is read."""
    limits.check("geometries", len(placed))
    limits.check("faces", sum(part.face_count for part, _ in placed))
    limits.check("vertices", sum(part.vertex_count for part, _ in placed))
    return join(_moved(part.read(), matrix) for part, matrix in placed)


def within(outer: Matrix, inner: Matrix) -> Matrix:
    """The matrix of what `inner` places within what `outer` places."""
    with np.errstate(over="ignore", invalid="ignore"):  # Mesh refuses what becomes infinite
        return outer @ inner


def _moved(triangles: Triangles, matrix: Matrix) -> Triangles:
    if np.array_equal(matrix, np.eye(4)):
        return triangles
    vertices, faces = triangles
    linear = matrix[:3, :3]
    # What overflows becomes infinite, which Mesh refuses.
    with np.errstate(over="ignore", invalid="ignore", divide="ignore"):
        moved = vertices @ linear.T + matrix[:3, 3]
        mirrored = np.linalg.det(linear / np.abs(linear).max(initial=1e-300)) < 0
    # A mirror turns triangles inside out.
    return moved, faces[:, ::-1] if mirrored else faces
