"""Measures of triangles, and operations on 3-vectors, the last axis of an array.

The arithmetic, and its order, is that of `model.topology.geometry`.
"""

from typing import NamedTuple

from meshconv3d.export.whole.arrays import (
    Array,
    cumulative_sum,
    sqrt,
    sum_in_order,
    take,
    where,
)


class FaceGeometry(NamedTuple):
    """As in `model.topology.geometry`. corners: F x 3 x 3, their positions; corner_sums and
    crosses: F x 3; doubles: F x 1; all float64."""

    corners: Array
    corner_sums: Array
    crosses: Array
    doubles: Array


def face_geometry(vertices: Array, faces: Array) -> FaceGeometry:
    """Measure every triangle. vertices: V x 3 float64. faces: F x 3."""
    corners = vertices[faces]
    a, b, c = (take(corners, s, axis=1) for s in range(3))
    crosses = cross(b - a, c - a)
    return FaceGeometry(corners, a + b + c, crosses, length(crosses))


def dot(a: Array, b: Array) -> Array:
    """... x 3 -> ... x 1."""
    return take(cumulative_sum(a * b, axis=-1), [2], axis=-1)


def cross(a: Array, b: Array) -> Array:
    """... x 3 -> ... x 3."""
    after, before = [1, 2, 0], [2, 0, 1]
    return take(a, after, -1) * take(b, before, -1) - take(a, before, -1) * take(b, after, -1)


def length(a: Array) -> Array:
    """... x 3 -> ... x 1."""
    return sqrt(dot(a, a))


def sum_where(present: Array, vectors: Array, axis: int) -> Array:
    """Sum, along an axis, of the vectors that are present, ... x 1 booleans."""
    return sum_in_order(where(present, vectors, 0.0), axis)
