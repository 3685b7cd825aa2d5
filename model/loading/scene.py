"""Scenes: parts that are placed, each maybe many times, to one list of triangles."""

from collections.abc import Sequence
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from meshconv3d.model.loading.limits import Limits
from meshconv3d.model.loading.triangles import Triangles, join

Matrix = NDArray[np.float64]  # 4 x 4, of column vectors
Matrices = NDArray[np.float64]  # N x 4 x 4

# A part, and the places at which it stands.
Placed = tuple["Part", Matrices]


class Part(Protocol):
    """Something with triangles, whose size is known before it is read."""

    @property
    def vertex_count(self) -> int: ...

    @property
    def face_count(self) -> int: ...

    def read(self) -> Triangles: ...


def flatten(placed: Sequence[Placed], limits: Limits) -> Triangles:
    """All parts where their matrices place them. Raises LimitExceeded before any is read."""
    limits.check("geometries", len(placed))
    faces = sum(part.face_count * len(where) for part, where in placed)
    limits.check("faces", faces)
    limits.check("vertices", sum(part.vertex_count * len(where) for part, where in placed))
    # Each part is read once, wherever it is placed.
    parts = {id(part): part for part, _ in placed}
    own = sum(part.face_count for part in parts.values())
    limits.check("repeated_faces", faces - own)
    places: dict[int, list[Matrices]] = {number: [] for number in parts}
    for part, where in placed:
        places[id(part)].append(where)
    return join(
        _moved(part.read(), np.concatenate(places[number])) for number, part in parts.items()
    )


def within(outer: Matrices, inner: Matrices) -> Matrices:
    """The matrices of what `inner` places within what `outer` places."""
    with np.errstate(over="ignore", invalid="ignore"):  # Mesh refuses what becomes infinite
        return outer @ inner


def _moved(triangles: Triangles, matrices: Matrices) -> Triangles:
    """The triangles, once for each matrix."""
    vertices, faces = triangles
    if len(matrices) == 1 and np.array_equal(matrices[0], np.eye(4)):
        return triangles
    linear = matrices[:, :3, :3]
    # What overflows becomes infinite, which Mesh refuses.
    with np.errstate(over="ignore", invalid="ignore", divide="ignore"):
        moved = vertices @ linear.transpose(0, 2, 1) + matrices[:, None, :3, 3]
        largest = np.abs(linear).max(axis=(1, 2), initial=1e-300)
        mirrored = np.linalg.det(linear / largest[:, None, None]) < 0
    # A mirror turns triangles inside out.
    turned = np.where(mirrored[:, None, None], faces[:, ::-1], faces)
    offsets = len(vertices) * np.arange(len(matrices))[:, None, None]
    # A bad index must stay bad, not name a vertex of the next instance.
    outside = (turned < 0) | (turned >= len(vertices))
    return moved.reshape(-1, 3), np.where(outside, -1, turned + offsets).reshape(-1, 3)
