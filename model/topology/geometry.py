"""Measures of triangles, and operations on 3-vectors for kernels."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from meshconv3d.model.jit import kernel

Vector = tuple[float, float, float]


class FaceGeometry(NamedTuple):
    """Centroids, normals and areas of F triangles, before the division that each needs.

    corner_sums: F x 3 float64, three times the centroid. crosses: F x 3, the cross product of two
    edges: its direction is the normal. doubles: F, its length, twice the area.
    """

    corner_sums: NDArray[np.float64]
    crosses: NDArray[np.float64]
    doubles: NDArray[np.float64]


@kernel
def face_geometry(vertices: NDArray[np.float64], faces: NDArray[np.int32]) -> FaceGeometry:
    """Measure every triangle."""
    corner_sums = np.empty((len(faces), 3))
    crosses = np.empty((len(faces), 3))
    doubles = np.empty(len(faces))
    for f in range(len(faces)):
        a, b, c = row(vertices, faces[f, 0]), row(vertices, faces[f, 1]), row(vertices, faces[f, 2])
        across = cross(subtract(b, a), subtract(c, a))
        write(corner_sums, f, add(add(a, b), c))
        write(crosses, f, across)
        doubles[f] = length(across)
    return FaceGeometry(corner_sums, crosses, doubles)


@kernel
def face_areas(vertices: NDArray[np.float64], faces: NDArray[np.int32]) -> NDArray[np.float64]:
    """Area of each triangle, F float64, in the square of the vertices' unit."""
    areas = np.empty(len(faces))
    for f in range(len(faces)):
        a, b, c = row(vertices, faces[f, 0]), row(vertices, faces[f, 1]), row(vertices, faces[f, 2])
        areas[f] = length(cross(subtract(b, a), subtract(c, a))) / 2
    return areas


def surface_area(vertices: NDArray[np.float64], faces: NDArray[np.int32]) -> float:
    """Total area of the triangles, in the square of the vertices' unit."""
    return float(face_areas(vertices, faces).sum())


def surface_centroid(geometry: FaceGeometry) -> NDArray[np.float64]:
    """Mean of the surface's points, 3 float64: that of the face centroids, weighted by area."""
    return _moment(geometry) / (geometry.doubles.sum() / 2)


@kernel
def _moment(geometry: FaceGeometry) -> NDArray[np.float64]:
    """Sum of the face centroids times their areas."""
    moment = np.zeros(3)
    for f in range(len(geometry.doubles)):
        for k in range(3):
            moment[k] += geometry.corner_sums[f, k] / 3 * (geometry.doubles[f] / 2)
    return moment


@kernel
def farthest(vertices: NDArray[np.float64], centre: NDArray[np.float64]) -> float:
    """Distance of the farthest vertex from a point."""
    most = 0.0
    for v in range(len(vertices)):
        step = subtract(row(vertices, v), (centre[0], centre[1], centre[2]))
        most = max(most, dot(step, step))
    return np.sqrt(most)


# 3-vectors are tuples, which stay in registers; an array would be allocated.


@kernel
def row(table: NDArray, i: int) -> Vector:
    """Row i of an N x 3 table."""
    return table[i, 0], table[i, 1], table[i, 2]


@kernel
def write(table: NDArray, i: int, a: Vector) -> None:
    """Set row i of an N x 3 table."""
    table[i, 0], table[i, 1], table[i, 2] = a


@kernel
def add(a: Vector, b: Vector) -> Vector:
    return a[0] + b[0], a[1] + b[1], a[2] + b[2]


@kernel
def subtract(a: Vector, b: Vector) -> Vector:
    return a[0] - b[0], a[1] - b[1], a[2] - b[2]


@kernel
def scale(a: Vector, factor: float) -> Vector:
    return a[0] * factor, a[1] * factor, a[2] * factor


@kernel
def dot(a: Vector, b: Vector) -> float:
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


@kernel
def cross(a: Vector, b: Vector) -> Vector:
    return a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]


@kernel
def length(a: Vector) -> float:
    return np.sqrt(dot(a, a))
