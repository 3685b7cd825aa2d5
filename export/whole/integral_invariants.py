"""Integral invariants: measures of the surface in balls around each face.

Definitions are those of `model.topology.integral_invariants`. Sums over balls are products of a
matrix that tells which points lie in which ball, F x P, with values of the points.
"""

import math

from meshconv3d.export.whole.arrays import (
    DOUBLE,
    INT,
    REAL,
    Array,
    absolute,
    arange,
    broadcast,
    ceil,
    concatenate,
    constant,
    cumulative_sum,
    expand,
    floor,
    full,
    inner,
    log,
    matmul,
    maximum,
    minimum,
    outer,
    roll,
    scatter,
    sqrt,
    stack,
    sum_in_order,
    sum_over,
    take,
    where,
)
from meshconv3d.export.whole.geometry import FaceGeometry, dot, length
from meshconv3d.model.topology.integral_invariants import (
    LARGEST_SHARE,
    MEASURES,
    MOST_FACES,
    RADII,
)

# Pairs of coordinates whose products are the second moments: xx, yy, zz, xy, xz, yz.
ROWS, COLUMNS = [0, 1, 2, 0, 0, 1], [0, 1, 2, 1, 2, 2]
# Each doubles the number of right digits of a root, of which the first guess has one.
NEWTON_STEPS = 5


def integral_invariants(geometry: FaceGeometry) -> Array:
    """F x M float32, M = MEASURES."""
    centroids, doubles = geometry.corner_sums / 3.0, geometry.doubles
    normals = geometry.crosses / where(doubles > 0.0, doubles, 1.0)
    points, owners, weights = _spread_points(geometry.corners, doubles / 2.0)
    point_normals = normals[owners]
    balls = _measure_balls(centroids, normals, points, point_normals, weights)
    place = _place_in_whole(centroids, normals, points, weights)
    measures = concatenate([balls.reshape(0, -1), place], 1).astype(REAL)
    return measures.reshape(-1, MEASURES)


def _measure_balls(
    centroids: Array, normals: Array, points: Array, point_normals: Array, weights: Array
) -> Array:
    """The measures of all balls, F x 5 x 8 float64.

    centroids, normals: F x 3. points, point_normals: P x 3. weights: P x 1. All float64.
    """
    # By coordinates, as in the kernel: a point on the edge of a ball must lie on the same side.
    x, y, z = (take(points, k, 1).reshape(1, -1) - take(centroids, [k], 1) for k in range(3))
    squares = x * x + y * y + z * z  # F x P
    # Area, first and second moments: float64, as covariances are their differences.
    products = take(points, ROWS, 1) * take(points, COLUMNS, 1)
    ones = full(1, DOUBLE, points.size(), 1)
    moments = concatenate([ones, points, products], 1) * weights  # P x 10
    # For the three other sums, float32 is enough, once the offsets of points that all but coincide
    # with a centroid are taken.
    towards = dot(points, point_normals).reshape(1, -1) - inner(centroids, point_normals)
    towards = towards.astype(REAL)
    own, there, facing, each = (
        array.astype(REAL) for array in (normals, points, point_normals, weights)
    )
    heights = inner(own, there) - dot(own, centroids.astype(REAL))
    each = each.reshape(1, -1)
    others = [
        absolute(heights) * each,
        absolute(inner(own, facing)) * each,
        towards * towards / maximum(squares.astype(REAL), 1e-12) * each,
    ]
    sums = []
    for radius in RADII[:-1]:
        inside = squares <= radius * radius
        within = inside.astype(REAL)
        of_others = [sum_over(other * within, 1, keepdims=True) for other in others]
        of_points = matmul(inside.astype(DOUBLE), moments)
        sums.append(concatenate([of_points, *(part.astype(DOUBLE) for part in of_others)], 1))
    whole = broadcast(sum_over(moments, 0, keepdims=True), centroids.size(), 10)
    of_others = [sum_over(other, 1, keepdims=True).astype(DOUBLE) for other in others]
    sums.append(concatenate([whole, *of_others], 1))
    return _measure_ball(stack(sums, 1), expand(centroids, 1))


def _measure_ball(sums: Array, centroids: Array) -> Array:
    """F x 5 x 13 sums, F x 1 x 3 centroids -> F x 5 x 8."""
    radii = constant([[[radius] for radius in RADII]], DOUBLE)
    area = take(sums, [0], 2)
    there = area > 0.0
    sums = sums / where(there, area, 1.0)
    mean = take(sums, [1, 2, 3], 2)
    second = take(sums, list(range(4, 10)), 2)
    covariance = second - take(mean, ROWS, 2) * take(mean, COLUMNS, 2)
    measures = [
        log((area / (radii * radii * math.pi) + 1.0).astype(REAL)).astype(DOUBLE),
        sqrt(maximum(_eigenvalues(covariance), 0.0)) / radii,
        length(mean - centroids) / radii,
        take(sums, [10], 2) / radii,
        take(sums, [11, 12], 2),
    ]
    return where(there, concatenate(measures, 2), 0.0)


def _eigenvalues(matrices: Array) -> Array:
    """Of symmetric matrices 3 x 3, largest first: ... x 6 (xx, yy, zz, xy, xz, yz) -> ... x 3.

    Smith 1961, where the largest is cos(acos(h) / 3): a root w of 4 w^3 - 3 w = h, which takes no
    trigonometry. Where h is negative, those of the negative matrix.
    """
    diagonal, rest = take(matrices, [0, 1, 2], 2), take(matrices, [3, 4, 5], 2)
    mean = sum_in_order(diagonal, 2) / 3.0
    mean = expand(mean, 2)
    deviation = diagonal - mean
    square = sum_over(deviation * deviation, 2, True) + sum_over(rest * rest, 2, True) * 2.0
    spread = sqrt(square / 6.0)
    round_ = spread < 1e-12
    scale = where(round_, 1.0, spread)
    a, b, c = (take(deviation / scale, [k], 2) for k in range(3))
    d, e, f = (take(rest / scale, [k], 2) for k in range(3))
    h = (a * (b * c - f * f) - d * (d * c - f * e) + e * (d * f - b * e)) / 2.0
    size = minimum(absolute(h), 1.0)
    root = size * (1 - math.sqrt(0.75)) + math.sqrt(0.75)
    for _ in range(NEWTON_STEPS):
        square = root * root
        root = root - (root * (square * 4.0 - 3.0) - size) / (square * 12.0 - 3.0)
    other = (root + sqrt(maximum(3.0 - root * root * 3.0, 0.0))) / 2.0
    positive = h >= 0.0
    largest = mean + spread * 2.0 * where(positive, root, other)
    least = mean - spread * 2.0 * where(positive, other, root)
    values = concatenate([largest, mean * 3.0 - largest - least, least], 2)
    return where(round_, mean, values)


def _place_in_whole(centroids: Array, normals: Array, points: Array, weights: Array) -> Array:
    """Where each face lies in the whole: F x 7 float64."""
    area = sum_over(weights, 0, keepdims=True)
    mean = sum_over(points * weights, 0, keepdims=True) / area
    offsets = points - mean
    covariance = outer(offsets, offsets * weights)
    trace = sum_over(sum_over(offsets * offsets * weights, 1), 0)
    covariance = covariance / trace
    c, n = centroids - mean, normals
    along_c, along_n = matmul(c, covariance), matmul(n, covariance)
    measures = [
        length(c),
        absolute(dot(c, n)),
        sqrt(maximum(dot(c, along_c), 0.0)),
        length(along_c),
        dot(n, along_n),
        length(along_n),
        absolute(dot(c, along_n)),
    ]
    return concatenate(measures, 1)


def _spread_points(corners: Array, areas: Array) -> tuple[Array, Array, Array]:
    """Points that stand for the surface: P x 3; the face of each, P; the area of each, P x 1.

    corners: F x 3 x 3. areas: F x 1. A face is cut into n x n triangles, in rows: row p has n - p
    that point up, and between them n - p - 1 that point down.
    """
    areas = _sample(areas)
    sides = ceil(sqrt(areas / (sum_in_order(areas, 0) * LARGEST_SHARE))).reshape(-1)
    squares = (sides * sides).astype(INT)
    # Row 0 of each face begins where the faces before it end. A face without points begins where
    # the next one does.
    ends = cumulative_sum(squares)
    starts = ends - squares
    count = ends[-1]
    begin = scatter(full(0, INT, count + 1), starts, full(1, INT, starts.size()), join="add")
    owners = (cumulative_sum(begin) - 1)[arange(count)]
    # Triangles of the face that are left, this one included: of whole rows and the rest of its own.
    n = sides[owners]
    left = (squares[owners] - (arange(count) - starts[owners])).astype(DOUBLE)
    rows = ceil(sqrt(left))
    place = (rows * rows - left).astype(INT)
    p = n - rows
    q = (place // 2).astype(DOUBLE)
    third = (place % 2 + 1).astype(DOUBLE) / 3.0
    u, v = expand((p + third) / n, 1), expand((q + third) / n, 1)
    a, b, c = (take(corners, s, axis=1)[owners] for s in range(3))
    points = a + u * (b - a) + v * (c - a)
    return points, owners, areas[owners] / expand(n * n, 1)


def _sample(areas: Array) -> Array:
    """The area that each face stands for, F x 1: of more than MOST_FACES faces, most have none."""
    count = areas.size()
    step = sum_in_order(areas, 0) / float(MOST_FACES)
    middles = floor(cumulative_sum(areas) / step + 0.5)
    passed = where(expand(arange(count), 1) > 0, roll(middles, -1, 0), 0.0)
    return where(count > MOST_FACES, (middles - passed) * step, areas)
