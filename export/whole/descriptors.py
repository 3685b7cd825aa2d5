"""Geometric terms of each face, and the features that pooling compares.

Definitions are those of `model.topology.descriptors`.
"""

from meshconv3d.export.whole.arrays import (
    DOUBLE,
    REAL,
    Array,
    absolute,
    argmax,
    broadcast,
    concatenate,
    expand,
    full,
    maximum,
    roll,
    scatter,
    stack,
    sum_in_order,
    take,
    take_along,
    where,
)
from meshconv3d.export.whole.geometry import FaceGeometry, cross, dot, length, sum_where
from meshconv3d.model.topology.descriptors import SHORTEST_TANGENT


def descriptor_terms(
    vertices: Array,
    faces: Array,
    twin: Array,
    geometry: FaceGeometry,
    absolute_offsets: bool,
    face_axes: bool,
) -> Array:
    """The 3-vectors of equations 1 and 2 for every face: F x 3 D float32.

    vertices: V x 3 float64. faces: F x 3. twin: H.
    """
    centroids, normals = _centroids_and_normals(geometry)
    centroid, normal = expand(centroids, 1), expand(normals, 1)  # F x 1 x 3
    offsets = geometry.corners - centroid
    axes = _face_axes(centroids, normals, offsets) if face_axes else None

    def along(vectors: Array) -> Array:
        """Components along the axes: F x n x 3 -> F x n x 3."""
        if axes is None:
            return vectors
        return sum_in_order(expand(vectors, 2) * expand(axes, 1), 3)

    beside = (twin >= 0).reshape(-1, 3, 1)
    neighbour = (maximum(twin, 0) // 3).reshape(-1, 3)
    before = roll(beside, 2, axis=1)
    # Of each half-edge, where the corner across it lies; of its twin, the apex of the neighbour.
    across = roll(geometry.corners, 2, axis=1).reshape(-1, 3)
    apexes = across[maximum(twin, 0)].reshape(-1, 3, 3)
    apex_steps = apexes - roll(apexes, 2, axis=1)
    steps = centroid - centroids[neighbour]
    products = cross(normal, normals[neighbour])
    corner_normals = sum_in_order(_average_normals(normals, faces, vertices)[faces], 1)
    along_offsets = along(offsets)
    terms = [
        sum_in_order(absolute(along_offsets) if absolute_offsets else along_offsets, 1),
        take(along(expand(corner_normals, 1)), 0, 1),
        sum_where(beside & before, absolute(along(apex_steps)), 1),
        take(along(centroid), 0, 1),
        take(along(normal), 0, 1),
        sum_where(beside, absolute(along(steps)), 1),
        sum_where(beside, absolute(along(products)), 1),
    ]
    return concatenate(terms, 1).astype(REAL)


def pooling_features(geometry: FaceGeometry) -> Array:
    """What geometric pooling compares in equation 5: centroid and normal, F x 6 float32."""
    return concatenate(_centroids_and_normals(geometry), 1).astype(REAL)


def _face_axes(centroids: Array, normals: Array, offsets: Array) -> Array:
    """The axes of each face, as rows: F x 3 x 3. offsets: F x 3 x 3, of corners from centroids."""
    tangents = _in_plane(centroids, normals)
    farthest = broadcast(argmax(dot(offsets, offsets), 1), offsets.size(), 1, 3)
    others = _in_plane(take(take_along(offsets, farthest, 1), 0, axis=1), normals)
    tangents = where(length(tangents) < SHORTEST_TANGENT, others, tangents)
    tangents = tangents * (1.0 / maximum(length(tangents), SHORTEST_TANGENT))
    return stack([normals, tangents, cross(normals, tangents)], 1)


def _in_plane(directions: Array, normals: Array) -> Array:
    """The parts of directions in the planes of faces: F x 3."""
    return directions - normals * dot(directions, normals)


def _centroids_and_normals(geometry: FaceGeometry) -> tuple[Array, Array]:
    """F x 3 each; the normal is zero where a face has no area."""
    doubles = geometry.doubles
    normals = where(doubles > 0.0, geometry.crosses * (1.0 / doubles), 0.0)
    return geometry.corner_sums * (1 / 3), normals


def _average_normals(normals: Array, faces: Array, vertices: Array) -> Array:
    """Mean of the face normals around every vertex: V x 3."""
    corners = broadcast(faces.reshape(-1, 1), faces.size() * 3, 3)
    each = broadcast(expand(normals, 1), faces.size(), 3, 3).reshape(-1, 3)
    sums = scatter(vertices * 0.0, corners, each, join="add")
    ones = full(1, DOUBLE, faces.size() * 3, 1)
    around = scatter(take(vertices, [0], 1) * 0.0, faces.reshape(-1, 1), ones, join="add")
    return sums * (1.0 / maximum(around, 1.0))
