"""Mesh: vertices and triangles, checked when it is made."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from meshconv3d.model.errors import UnusableMesh
from meshconv3d.model.jit import kernel


@dataclass(frozen=True, eq=False)
class Mesh:
    """Immutable, valid triangle mesh.

    vertices: V x 3 float64, finite, not all in one point.
    faces: F x 3 int32, F >= 1, every entry in [0, V).
    note: parts that reading left out or guessed, as a sentence for people; mostly empty.

    Raises UnusableMesh, naming the fault and its count, when the arrays are anything else.
    """

    vertices: NDArray[np.float64]
    faces: NDArray[np.int32]
    note: str = ""

    def __init__(self, vertices: ArrayLike, faces: ArrayLike, note: str = "") -> None:
        vertex_array = np.array(vertices, dtype=np.float64, order="C")
        face_array = np.asarray(faces)
        _check_shape(vertex_array, face_array)
        face_array = np.array(face_array, dtype=np.int32, order="C")
        _check_extent(vertex_array, face_array)
        vertex_array.setflags(write=False)
        face_array.setflags(write=False)
        object.__setattr__(self, "vertices", vertex_array)
        object.__setattr__(self, "faces", face_array)
        object.__setattr__(self, "note", note)

    def moved(self, vertices: ArrayLike) -> "Mesh":
        """The same triangles over other vertex positions (V x 3)."""
        return Mesh(vertices, self.faces)


def _check_shape(vertices: NDArray, faces: NDArray) -> None:
    if vertices.ndim != 2 or vertices.shape[1] != 3:
        raise UnusableMesh(
            "bad-vertices", f"vertices must be an array of V x 3 numbers, got {vertices.shape}"
        )
    if faces.size == 0:
        raise UnusableMesh(
            "no-faces",
            f"there are no triangles ({len(vertices)} points): "
            "point clouds, curves and empty scenes cannot be classified; export a surface mesh",
        )
    if faces.ndim != 2 or faces.shape[1] != 3 or faces.dtype.kind not in "iu":
        raise UnusableMesh(
            "bad-faces",
            f"faces must be an array of F x 3 integers, got {faces.dtype} {faces.shape}",
        )
    if faces.min() < 0 or faces.max() >= len(vertices):
        outside = np.count_nonzero((faces < 0) | (faces >= len(vertices)))
        raise UnusableMesh(
            "index-out-of-range",
            f"{outside} of {faces.size} face corners name a vertex that does not exist "
            f"(valid: 0 to {len(vertices) - 1}); correct the faces, or export the mesh again",
        )


def _check_extent(vertices: NDArray[np.float64], faces: NDArray[np.int32]) -> None:
    used, bad, low, high = _measure(vertices, faces)
    if bad:
        raise UnusableMesh(
            "non-finite-vertices",
            f"{bad} of {used} vertices are NaN or infinite; repair or export the mesh again",
        )
    with np.errstate(over="ignore"):
        extent = high - low
    if not np.isfinite(extent).all():
        raise UnusableMesh(
            "extent-overflow",
            f"the mesh spans {low.min():.3g} to {high.max():.3g}, "
            "more than a floating-point number can measure; scale it down",
        )
    if not extent.any():
        raise UnusableMesh(
            "zero-extent",
            f"all {used} vertices lie in one point; export the mesh "
            "again, in units in which it does not vanish",
        )


@kernel
def _measure(
    vertices: NDArray[np.float64], faces: NDArray[np.int32]
) -> tuple[int, int, NDArray[np.float64], NDArray[np.float64]]:
    """(used, bad, low, high): how many vertices faces use, how many of these are not finite, and
    the lowest and highest coordinates of the others."""
    named = np.zeros(len(vertices), np.bool_)
    for f in range(len(faces)):
        for s in range(3):
            named[faces[f, s]] = True
    low, high = np.full(3, np.inf), np.full(3, -np.inf)
    used = 0
    bad = 0
    for v in range(len(vertices)):
        if not named[v]:
            continue
        used += 1
        x, y, z = vertices[v, 0], vertices[v, 1], vertices[v, 2]
        if not (np.isfinite(x) and np.isfinite(y) and np.isfinite(z)):
            bad += 1
            continue
        for k in range(3):
            low[k] = min(low[k], vertices[v, k])
            high[k] = max(high[k], vertices[v, k])
    return used, bad, low, high
