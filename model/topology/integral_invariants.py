"""Integral invariants: measures of the surface in balls around each face, across gaps.

Equations 1 and 2 reach one face far, patches a few, and neither reaches other parts of the mesh.
These measures cover all surface near a face, of every part, within balls of growing radius (as in
Pottmann et al. 2009), and the position of the face in the whole mesh. They depend neither on the
rotation of the mesh nor on the winding of its faces.
"""

import math

import numpy as np
from numpy.typing import NDArray

from meshconv3d.model.jit import kernel
from meshconv3d.model.topology.geometry import FaceGeometry

# Of the balls, in radii of the unit sphere; the last holds any mesh.
RADII = (0.1, 0.2, 0.4, 0.8, 2.0)
IN_BALL, IN_WHOLE = 8, 7
MEASURES = IN_BALL * len(RADII) + IN_WHOLE
# A face of a larger share of the area is cut up: a point stands for no more surface than this.
LARGEST_SHARE = 1 / 100
# Of more faces, a sample stands for all.
MOST_FACES = 512
# Sums over a ball: area, its first and second moments, and three measures weighed by area.
SUMS = 13


@kernel
def integral_invariants(
    vertices: NDArray[np.float64], faces: NDArray[np.int32], geometry: FaceGeometry
) -> NDArray[np.float32]:
    """F x M float32, M = MEASURES. vertices: V x 3 float64, in the unit sphere.

    For each ball around the centroid of a face with normal n, over the area in it, which lies at
    offsets x from the centroid and has normals m:

        0    log(1 + area / pi r^2), r the ball's radius
        1-3  standard deviations along the principal axes of the x, largest first, / r
        4    length of the mean x / r
        5    mean |x . n| / r
        6    mean |n . m|
        7    mean (x . m)^2 / |x|^2

    then for its centroid c, from the mean of the whole surface, whose covariance over its trace
    is C: |c|, |c . n|, sqrt(c C c), |C c|, n C n, |C n|, |c C n|.
    """
    centroids, areas = geometry.corner_sums / 3, geometry.doubles / 2
    # No normal where there is no area.
    normals = geometry.crosses / np.where(geometry.doubles > 0, geometry.doubles, 1.0)[:, None]
    points, point_normals, weights = _spread_points(vertices, faces, normals, areas)
    out = np.zeros((len(faces), MEASURES), np.float32)
    sums = np.empty((len(RADII), SUMS))
    for f in range(len(faces)):
        _sum_balls(centroids[f], normals[f], points, point_normals, weights, sums)
        for ball in range(len(RADII)):
            if sums[ball, 0] > 0:
                _measure_ball(sums[ball], RADII[ball], out[f, IN_BALL * ball :])
    _place_in_whole(centroids, normals, points, weights, out[:, IN_BALL * len(RADII) :])
    return out


@kernel
def _sum_balls(
    centroid: NDArray[np.float64],
    normal: NDArray[np.float64],
    points: NDArray[np.float64],
    point_normals: NDArray[np.float64],
    weights: NDArray[np.float64],
    sums: NDArray[np.float64],
) -> None:
    """Write what each ball holds: first what each adds to the one before, then the totals."""
    sums[:] = 0.0
    for i in range(len(points)):
        x = points[i, 0] - centroid[0]
        y = points[i, 1] - centroid[1]
        z = points[i, 2] - centroid[2]
        square = x * x + y * y + z * z
        ball = 0
        while ball < len(RADII) - 1 and square > RADII[ball] * RADII[ball]:
            ball += 1
        m = point_normals[i]
        height = x * normal[0] + y * normal[1] + z * normal[2]
        likeness = m[0] * normal[0] + m[1] * normal[1] + m[2] * normal[2]
        facing = x * m[0] + y * m[1] + z * m[2]
        w, s = weights[i], sums[ball]
        s[0] += w
        s[1] += w * x
        s[2] += w * y
        s[3] += w * z
        s[4] += w * x * x
        s[5] += w * y * y
        s[6] += w * z * z
        s[7] += w * x * y
        s[8] += w * x * z
        s[9] += w * y * z
        s[10] += w * abs(height)
        s[11] += w * abs(likeness)
        s[12] += w * facing * facing / max(square, 1e-12)
    for ball in range(1, len(RADII)):
        for k in range(SUMS):
            sums[ball, k] += sums[ball - 1, k]


@kernel
def _measure_ball(s: NDArray[np.float64], radius: float, out: NDArray[np.float32]) -> None:
    area = s[0]
    x, y, z = s[1] / area, s[2] / area, s[3] / area
    largest, middle, least = _eigenvalues(
        s[4] / area - x * x,
        s[5] / area - y * y,
        s[6] / area - z * z,
        s[7] / area - x * y,
        s[8] / area - x * z,
        s[9] / area - y * z,
    )
    out[0] = math.log1p(area / (math.pi * radius * radius))
    out[1] = math.sqrt(max(largest, 0.0)) / radius
    out[2] = math.sqrt(max(middle, 0.0)) / radius
    out[3] = math.sqrt(max(least, 0.0)) / radius
    out[4] = math.sqrt(x * x + y * y + z * z) / radius
    out[5] = s[10] / area / radius
    out[6] = s[11] / area
    out[7] = s[12] / area


@kernel
def _eigenvalues(
    xx: float, yy: float, zz: float, xy: float, xz: float, yz: float
) -> tuple[float, float, float]:
    """Of a symmetric matrix 3 x 3, largest first (Smith 1961)."""
    mean = (xx + yy + zz) / 3
    spread = (xx - mean) ** 2 + (yy - mean) ** 2 + (zz - mean) ** 2
    spread = math.sqrt((spread + 2 * (xy * xy + xz * xz + yz * yz)) / 6)
    if spread < 1e-12:
        return mean, mean, mean
    a, b, c = (xx - mean) / spread, (yy - mean) / spread, (zz - mean) / spread
    d, e, f = xy / spread, xz / spread, yz / spread
    half_determinant = (a * (b * c - f * f) - d * (d * c - f * e) + e * (d * f - b * e)) / 2
    angle = math.acos(min(1.0, max(-1.0, half_determinant))) / 3
    largest = mean + 2 * spread * math.cos(angle)
    least = mean + 2 * spread * math.cos(angle + 2 * math.pi / 3)
    return largest, 3 * mean - largest - least, least


@kernel
def _times(matrix: NDArray[np.float64], vector: NDArray[np.float64]) -> NDArray[np.float64]:
    """The product of a 3 x 3 matrix with a vector; numba would need SciPy for the operator."""
    product = np.zeros(3)
    for k in range(3):
        for j in range(3):
            product[k] += matrix[k, j] * vector[j]
    return product


@kernel
def _place_in_whole(
    centroids: NDArray[np.float64],
    normals: NDArray[np.float64],
    points: NDArray[np.float64],
    weights: NDArray[np.float64],
    out: NDArray[np.float32],
) -> None:
    """Write where each face lies: by products with the covariance, which has no preferred axes."""
    mean = np.zeros(3)
    covariance = np.zeros((3, 3))
    for i in range(len(points)):
        for k in range(3):
            mean[k] += weights[i] * points[i, k]
    mean /= weights.sum()
    for i in range(len(points)):
        for k in range(3):
            for j in range(3):
                product = (points[i, k] - mean[k]) * (points[i, j] - mean[j])
                covariance[k, j] += weights[i] * product
    covariance /= covariance[0, 0] + covariance[1, 1] + covariance[2, 2]
    for f in range(len(centroids)):
        c = centroids[f] - mean
        n = normals[f]
        along_c, along_n = _times(covariance, c), _times(covariance, n)
        out[f, 0] = math.sqrt(_dot(c, c))
        out[f, 1] = abs(_dot(c, n))
        out[f, 2] = math.sqrt(max(_dot(c, along_c), 0.0))
        out[f, 3] = math.sqrt(_dot(along_c, along_c))
        out[f, 4] = _dot(n, along_n)
        out[f, 5] = math.sqrt(_dot(along_n, along_n))
        out[f, 6] = abs(_dot(c, along_n))


@kernel
def _spread_points(
    vertices: NDArray[np.float64],
    faces: NDArray[np.int32],
    normals: NDArray[np.float64],
    areas: NDArray[np.float64],
) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
    """Points that stand for the surface: P x 3, their normals P x 3, and their areas P.

    A face is cut into equal triangles, n to a side, and each centroid is a point. Up to MOST_FACES
    faces it does not matter in which order they or their corners are named.
    """
    areas = _sample(areas)
    largest = areas.sum() * LARGEST_SHARE
    sides = np.empty(len(faces), np.int64)
    for f in range(len(faces)):
        sides[f] = math.ceil(math.sqrt(areas[f] / largest))
    count = (sides * sides).sum()
    points, point_normals = np.empty((count, 3)), np.empty((count, 3))
    weights = np.empty(count)
    i = 0
    for f in range(len(faces)):
        a, b, c = vertices[faces[f, 0]], vertices[faces[f, 1]], vertices[faces[f, 2]]
        n = sides[f]
        for p in range(n):
            for q in range(n - p):
                # In the cell at p and q one triangle points up and, but for the last, one down.
                for third in range(1, 3 if q < n - p - 1 else 2):
                    u, v = (p + third / 3) / n, (q + third / 3) / n
                    for k in range(3):
                        points[i, k] = a[k] + u * (b[k] - a[k]) + v * (c[k] - a[k])
                        point_normals[i, k] = normals[f, k]
                    weights[i] = areas[f] / (n * n)
                    i += 1
    return points, point_normals, weights


@kernel
def _sample(areas: NDArray[np.float64]) -> NDArray[np.float64]:
    """The area that each face stands for: its own, up to MOST_FACES faces.

    Beyond, the surface is divided into MOST_FACES equal areas, in the order of the faces, and the
    face in the middle of each stands for it (systematic sampling). Most faces stand for nothing.
    """
    if len(areas) <= MOST_FACES:
        return areas
    step = areas.sum() / MOST_FACES
    weights = np.zeros(len(areas))
    running = 0.0
    passed = 0
    for f in range(len(areas)):
        running += areas[f]
        middles = int(running / step + 0.5)
        weights[f] = (middles - passed) * step
        passed = middles
    return weights


@kernel
def _dot(a: NDArray[np.float64], b: NDArray[np.float64]) -> float:
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
