"""Polygons to triangles, and the parts of a file to one list of triangles."""

from collections.abc import Iterable

import numpy as np
from numpy.typing import NDArray

from meshconv3d.model.errors import MalformedFile
from meshconv3d.model.jit import inlined, kernel
from meshconv3d.model.loading.limits import Limits

# Vertices V x 3 and triangles F x 3. What is wrong with them is for Mesh to say, so an index that
# names no vertex is kept, never wrapped.
Triangles = tuple[NDArray[np.float64], NDArray[np.int64]]
# With a note on what reading left out or had to guess.
NotedTriangles = tuple[NDArray[np.float64], NDArray[np.int64], str]

# Of a polygon's area: what the triangles of a fan may overlap by rounding.
_ROUNDING = 1e-9
# Times that a polygon may have corners left but none that can be cut. It happens only to one that
# crosses itself; after that its corners are cut as they come.
_MOST_STALLS = 16


def triangulate(
    vertices: NDArray[np.float64],
    corners: NDArray,
    counts: NDArray[np.int64],
    limits: Limits,
) -> NDArray[np.int64]:
    """Triangles (F x 3) of polygons: N - 2 for each of N corners, wound as it is.

    A convex polygon becomes a fan around its first corner. Ears are cut from one where the fan
    would overlap itself, seen along the polygon's normal.

    vertices: V x 3.
    corners: vertex indices of all polygons one after another, sum(counts).
    counts: corners of each polygon. One with fewer than three has no triangle.

    Raises LimitExceeded when there are too many, or concave ones of too many corners;
    MalformedFile when corners are no whole numbers.
    """
    limits.check("faces", int(np.maximum(counts - 2, 0).sum()))
    corners = indices(corners)
    if (counts == 3).all():
        return corners.reshape(-1, 3)
    # Where a corner names no vertex, Mesh refuses whatever is made of it.
    exist = bool(((corners >= 0) & (corners < len(vertices))).all())
    faces, steps = _triangulate(vertices, corners, counts, exist, limits.ear_steps)
    limits.check(
        "ear_steps",
        steps,
        f"its concave polygons have too many corners: to cut them takes {steps} steps",
    )
    return faces


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


@kernel
def _triangulate(vertices, corners, counts, exist, most_steps):
    """The triangles, and the steps that cutting ears took: all, or until there were too many.

    exist: whether all corners name a vertex; else polygons become fans.
    """
    triangles = largest = 0
    for count in counts:
        triangles += max(count - 2, 0)
        largest = max(largest, count)
    faces = np.empty((triangles, 3), np.int64)
    x, y = np.empty(largest), np.empty(largest)
    ring = np.empty((3, largest), np.int64)
    start = face = steps = 0
    for count in counts:
        polygon = corners[start : start + count]
        start += count
        for step in range(count - 2):
            _set(faces, face + step, polygon[0], polygon[step + 1], polygon[step + 2])
        least = _flatten_concave(vertices, polygon, x, y) if exist and count > 3 else 0.0
        if least > 0:
            steps += _cut_ears(polygon, x, y, least, ring, faces[face:], most_steps - steps)
            if steps > most_steps:
                break
        face += max(count - 2, 0)
    return faces, steps


@kernel
def _flatten_concave(vertices, polygon, x, y):
    """Set x and y to the corners in 2D, where the triangles of a fan would overlap.

    They are projected along the axis that is closest to the polygon's normal (Newell's), and wound
    counterclockwise. Returns twice the area below which a triangle has none but by rounding; 0 for
    a polygon that is to be a fan: a convex one, and one that has no area or a corner that is NaN,
    for which nothing is right.
    """
    x_normal = y_normal = z_normal = 0.0
    for step in range(1, len(polygon) - 1):
        u, v, w = _cross(vertices, polygon[0], polygon[step], polygon[step + 1])
        x_normal, y_normal, z_normal = x_normal + u, y_normal + v, z_normal + w
    overlap = 0.0
    for step in range(1, len(polygon) - 1):
        u, v, w = _cross(vertices, polygon[0], polygon[step], polygon[step + 1])
        overlap -= min(u * x_normal + v * y_normal + w * z_normal, 0.0)
    if not overlap > _ROUNDING * (x_normal**2 + y_normal**2 + z_normal**2):
        return 0.0
    area, u, v = x_normal, 1, 2
    if abs(y_normal) > abs(area):
        area, u, v = y_normal, 2, 0
    if abs(z_normal) > abs(area):
        area, u, v = z_normal, 0, 1
    if area < 0:
        u, v = v, u
    for corner in range(len(polygon)):
        x[corner], y[corner] = vertices[polygon[corner], u], vertices[polygon[corner], v]
    return _ROUNDING * abs(area)


@inlined
def _cross(vertices, a, b, c):
    """The normal of a triangle, as long as twice its area."""
    u, x = vertices[b, 0] - vertices[a, 0], vertices[c, 0] - vertices[a, 0]
    v, y = vertices[b, 1] - vertices[a, 1], vertices[c, 1] - vertices[a, 1]
    w, z = vertices[b, 2] - vertices[a, 2], vertices[c, 2] - vertices[a, 2]
    return v * z - w * y, w * x - u * z, u * y - v * x


@kernel
def _cut_ears(polygon, x, y, least, ring, faces, most_steps):
    """Set the triangles of a concave polygon; returns the steps taken, of about a nanosecond.

    x, y: its corners in 2D, counterclockwise. least: twice the least area that a triangle has.
    ring: room for the corners that are left: the one before each, the one after, and whether it is
    an ear.

    To cut one ear changes what its neighbours are, and no others, unless corners lie on one line:
    where no ear is left, all are looked at again. To pass over the corner after each that is cut
    keeps triangles from becoming thin.
    """
    before, after, ears = ring
    count = left = len(polygon)
    for corner in range(count):
        before[corner], after[corner], ears[corner] = corner - 1, corner + 1, False
    before[0], after[count - 1] = count - 1, 0
    corner = stalls = 0
    steps = 2 * count * count
    looked = False  # at all corners that are left
    while left > 3 and steps <= most_steps:
        seen = 0
        while seen < left and not ears[corner]:
            corner = after[corner]
            seen += 1
        if seen == left and not looked and stalls < _MOST_STALLS:
            for _ in range(left):
                ears[corner] = _is_ear(x, y, least, before, after, corner)
                corner = after[corner]
            steps += left * left
            looked = True
            continue
        if seen == left:
            corner, flat = _without_ears(x, y, least, before, after, corner, left)
            stalls += not flat
        first, last = before[corner], after[corner]
        _set(faces, count - left, polygon[first], polygon[corner], polygon[last])
        after[first], before[last] = last, first
        left -= 1
        ears[first] = _is_ear(x, y, least, before, after, first)
        ears[last] = _is_ear(x, y, least, before, after, last)
        looked = False
        corner = after[last]
    first, last = before[corner], after[corner]
    _set(faces, count - 3, polygon[first], polygon[corner], polygon[last])
    return steps


@kernel
def _is_ear(x, y, least, before, after, corner):
    """Whether the triangle of a corner has an area and holds no other part of the outline.

    Reflex corners tell. One that meets a corner of the triangle, as where a hole is joined to the
    outline, does not lie in it.
    """
    a, c = before[corner], after[corner]
    xa, ya, xb, yb, xc, yc = x[a], y[a], x[corner], y[corner], x[c], y[c]
    if not _turn(xa, ya, xb, yb, xc, yc) > least:
        return False
    low_x, high_x = min(xa, xb, xc), max(xa, xb, xc)
    low_y, high_y = min(ya, yb, yc), max(ya, yb, yc)
    other = after[c]
    while other != a:
        px, py = x[other], y[other]
        if (
            low_x <= px <= high_x
            and low_y <= py <= high_y
            and _turn(xa, ya, xb, yb, px, py) >= 0
            and _turn(xb, yb, xc, yc, px, py) >= 0
            and _turn(xc, yc, xa, ya, px, py) >= 0
            and not (px == xa and py == ya)
            and not (px == xb and py == yb)
            and not (px == xc and py == yc)
        ):
            p, n = before[other], after[other]
            if _turn(x[p], y[p], px, py, x[n], y[n]) <= least:
                return False
        other = after[other]
    return True


@kernel
def _without_ears(x, y, least, before, after, corner, left):
    """The corner to cut where there is no ear, and whether it has no area.

    One without area can be cut anywhere. There is one, or else the polygon crosses itself, and no
    way to cut it is right: then a convex one.
    """
    convex = corner
    for _ in range(left):
        a, c = before[corner], after[corner]
        turn = _turn(x[a], y[a], x[corner], y[corner], x[c], y[c])
        if abs(turn) <= least:
            return corner, True
        if turn > 0:
            convex = corner
        corner = after[corner]
    return convex, False


@inlined
def _turn(xa, ya, xb, yb, xc, yc):
    """Twice the area of a triangle, positive where it is counterclockwise."""
    return (xb - xa) * (yc - yb) - (yb - ya) * (xc - xb)


@inlined
def _set(faces, face, a, b, c):
    faces[face, 0], faces[face, 1], faces[face, 2] = a, b, c
