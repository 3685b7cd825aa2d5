"""Quadrics: sums of weighted squared distances to planes and points (Garland and Heckbert 1997).

A quadric is ten numbers, p A p + 2 b p + c at the point p: xx, xy, xz, yy, yz, zz of the symmetric
3 x 3 matrix A, then b, then c.
"""

import numpy as np
from numpy.typing import NDArray

from meshconv3d.model.jit import kernel
from meshconv3d.model.topology.geometry import (
    Vector,
    add,
    cross,
    dot,
    length,
    row,
    scale,
    subtract,
)

# Weight of the squared distance to the plane that stands on the face along a border edge, in units
# of the edge's squared length: borders stay where they are.
BORDER_WEIGHT = 0.5
# Weight of the squared distances to the vertices as they were, in units of the faces' area: small,
# but where the surface is flat, the planes alone leave the place open.
POINT_WEIGHT = 3e-4


@kernel
def vertex_quadrics(
    vertices: NDArray[np.float64], faces: NDArray[np.int32], twin: NDArray[np.int32]
) -> NDArray[np.float64]:
    """Quadric of every vertex, V x 10: of the planes of its faces, weighted by their areas.

    twin: H int32.
    """
    quadrics = np.zeros((len(vertices), 10))
    for f in range(len(faces)):
        a, b, c = row(vertices, faces[f, 0]), row(vertices, faces[f, 1]), row(vertices, faces[f, 2])
        across = cross(subtract(b, a), subtract(c, a))
        double = length(across)
        normal, area = scale(across, 1 / double), double / 2
        for s in range(3):
            u, v = faces[f, s], faces[f, (s + 1) % 3]
            _add_plane(quadrics, u, normal, a, area)
            _add_point(quadrics, u, row(vertices, u), area * POINT_WEIGHT)
            if twin[3 * f + s] < 0:
                start = row(vertices, u)
                edge = subtract(row(vertices, v), start)
                square = dot(edge, edge)
                outward = scale(cross(edge, normal), 1 / np.sqrt(square))
                for end in (u, v):
                    _add_plane(quadrics, end, outward, start, square * BORDER_WEIGHT)
    return quadrics


@kernel
def _add_plane(
    quadrics: NDArray[np.float64], v: int, normal: Vector, point: Vector, weight: float
) -> None:
    offset = -dot(normal, point)
    x, y, z = normal
    weighted_x, weighted_y, weighted_z = weight * x, weight * y, weight * z
    quadrics[v, 0] += weighted_x * x
    quadrics[v, 1] += weighted_x * y
    quadrics[v, 2] += weighted_x * z
    quadrics[v, 3] += weighted_y * y
    quadrics[v, 4] += weighted_y * z
    quadrics[v, 5] += weighted_z * z
    quadrics[v, 6] += weighted_x * offset
    quadrics[v, 7] += weighted_y * offset
    quadrics[v, 8] += weighted_z * offset
    quadrics[v, 9] += weight * offset * offset


@kernel
def _add_point(quadrics: NDArray[np.float64], v: int, point: Vector, weight: float) -> None:
    quadrics[v, 0] += weight
    quadrics[v, 3] += weight
    quadrics[v, 5] += weight
    quadrics[v, 6] -= weight * point[0]
    quadrics[v, 7] -= weight * point[1]
    quadrics[v, 8] -= weight * point[2]
    quadrics[v, 9] += weight * dot(point, point)


@kernel
def least_point(
    quadrics: NDArray[np.float64], u: int, v: int, start: Vector, end: Vector
) -> tuple[Vector, float]:
    """The point at which the sum of two vertices' quadrics is least, and that least value.

    start, end: of the edge that is to become this point; its middle is taken where rounding leaves
    no single least point.
    """
    xx, xy, xz = (
        quadrics[u, 0] + quadrics[v, 0],
        quadrics[u, 1] + quadrics[v, 1],
        quadrics[u, 2] + quadrics[v, 2],
    )
    yy, yz, zz = (
        quadrics[u, 3] + quadrics[v, 3],
        quadrics[u, 4] + quadrics[v, 4],
        quadrics[u, 5] + quadrics[v, 5],
    )
    x, y, z, constant = (
        quadrics[u, 6] + quadrics[v, 6],
        quadrics[u, 7] + quadrics[v, 7],
        quadrics[u, 8] + quadrics[v, 8],
        quadrics[u, 9] + quadrics[v, 9],
    )
    # Cofactors of A, which is positive definite but for rounding.
    a, b, c = yy * zz - yz * yz, xz * yz - xy * zz, xy * yz - xz * yy
    d, e, f = xx * zz - xz * xz, xy * xz - xx * yz, xx * yy - xy * xy
    determinant = xx * a + xy * b + xz * c
    if determinant > 0:
        r = -1 / determinant
        point = (
            r * (a * x + b * y + c * z),
            r * (b * x + d * y + e * z),
            r * (c * x + e * y + f * z),
        )
        return point, max(x * point[0] + y * point[1] + z * point[2] + constant, 0.0)
    point = scale(add(start, end), 0.5)
    image = (
        xx * point[0] + xy * point[1] + xz * point[2] + 2 * x,
        xy * point[0] + yy * point[1] + yz * point[2] + 2 * y,
        xz * point[0] + yz * point[1] + zz * point[2] + 2 * z,
    )
    return point, max(dot(point, image) + constant, 0.0)
