"""Mesh: vertices and triangles, checked when it is made."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from meshconv3d.model.errors import UnusableMesh


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
        _check(vertex_array, face_array)
        face_array = np.array(face_array, dtype=np.int32, order="C")
        vertex_array.setflags(write=False)
        face_array.setflags(write=False)
        object.__setattr__(self, "vertices", vertex_array)
        object.__setattr__(self, "faces", face_array)
        object.__setattr__(self, "note", note)

    def moved(self, vertices: ArrayLike) -> "Mesh":
        """The same triangles over other vertex positions (V x 3)."""
        return Mesh(vertices, self.faces)


def _check(vertices: NDArray, faces: NDArray) -> None:
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
    named = np.zeros(len(vertices), bool)
    named[faces] = True
    used = vertices[named]
    if not np.isfinite(used).all():
        bad = np.count_nonzero(~np.isfinite(used).all(axis=1))
        raise UnusableMesh(
            "non-finite-vertices",
            f"{bad} of {len(used)} vertices are NaN or infinite; repair or export the mesh again",
        )
    with np.errstate(over="ignore"):
        extent = np.ptp(used, axis=0)
    if not np.isfinite(extent).all():
        raise UnusableMesh(
            "extent-overflow",
            f"the mesh spans {used.min():.3g} to {used.max():.3g}, "
            "more than a floating-point number can measure; scale it down",
        )
    if not extent.any():
        raise UnusableMesh(
            "zero-extent",
            f"all {len(used)} vertices lie in one point; export the mesh "
            "again, in units in which it does not vanish",
        )
