"""Geometric terms, the input of the learned descriptors (paper, equations 1 and 2)."""

import numpy as np
from numpy.typing import NDArray

from meshconv3d.model.jit import kernel
from meshconv3d.model.topology.geometry import (
    FaceGeometry,
    Vector,
    add,
    cross,
    dot,
    length,
    row,
    scale,
    subtract,
    write,
)

# Seven 3-vectors for each face: the first three are equation 1's, the last four equation 2's.
GEODESIC_TERMS = ("corner offsets", "corner normals", "apex edge differences")
GEOMETRIC_TERMS = ("centroid", "normal", "centroid differences", "normal cross products")

# In radii of the unit sphere. The direction of a shorter vector is noise.
SHORTEST_TANGENT = 1e-3


@kernel
def descriptor_terms(
    vertices: NDArray[np.float64],
    faces: NDArray[np.int32],
    twin: NDArray[np.int32],
    geometry: FaceGeometry,
    absolute_offsets: bool,
    face_axes: bool,
) -> NDArray[np.float32]:
    """The 3-vectors of equations 1 and 2 for every face: F x D x 3 float32, D = 7.

    vertices: V x 3 float64, centred. faces: F x 3 int32. twin: H int32, see `find_twins`.
    In order, with corners v_i, centroid c, unit normal n, corner normals n_i (the mean normal of
    the faces around the corner's vertex), neighbours j, and |.| per component:

        0  sum_i (v_i - c), identically zero; with absolute_offsets, sum_i |v_i - c|
        1  sum_i n_i
        2  sum_i |e_i1 - e_i2|, edges from corner i to the apexes of the two neighbours there
        3  c
        4  n
        5  sum_j |c - c_j|
        6  sum_j |n x n_j|

    A missing neighbour adds nothing to a sum; so does a corner with only one neighbour to its
    term in 2. The normal of a face without area is zero. Components are those along the axes of
    the file or, with face_axes, along those of each face, see `_face_axes`.
    """
    centroids, normals = _centroids_and_normals(geometry)
    vertex_normals = _average_normals(normals, faces, len(vertices))
    terms = np.empty((7 * len(faces), 3), np.float32)
    axes = ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))
    for f in range(len(faces)):
        centroid, normal = row(centroids, f), row(normals, f)
        if face_axes:
            axes = _face_axes(vertices, faces, f, centroid, normal)
        offsets = corner_normals = apex_differences = (0.0, 0.0, 0.0)
        centroid_differences = normal_products = (0.0, 0.0, 0.0)
        for s in range(3):
            offset = _along(axes, subtract(row(vertices, faces[f, s]), centroid))
            offsets = add(offsets, _magnitudes(offset) if absolute_offsets else offset)
            corner_normals = add(corner_normals, row(vertex_normals, faces[f, s]))
            t, before = twin[3 * f + s], twin[3 * f + (s + 2) % 3]
            if t >= 0:
                step = subtract(centroid, row(centroids, t // 3))
                centroid_differences = add(centroid_differences, _magnitudes(_along(axes, step)))
                product = cross(normal, row(normals, t // 3))
                normal_products = add(normal_products, _magnitudes(_along(axes, product)))
            if t >= 0 and before >= 0:
                # Corner s lies between side s and the side before it. Both edges start at the
                # corner, so that their difference is that of the apexes.
                step = subtract(row(vertices, _apex(faces, t)), row(vertices, _apex(faces, before)))
                apex_differences = add(apex_differences, _magnitudes(_along(axes, step)))
        write(terms, 7 * f, offsets)
        write(terms, 7 * f + 1, _along(axes, corner_normals))
        write(terms, 7 * f + 2, apex_differences)
        write(terms, 7 * f + 3, _along(axes, centroid))
        write(terms, 7 * f + 4, _along(axes, normal))
        write(terms, 7 * f + 5, centroid_differences)
        write(terms, 7 * f + 6, normal_products)
    return terms.reshape(len(faces), 7, 3)


@kernel
def pooling_features(geometry: FaceGeometry) -> NDArray[np.float32]:
    """Features that geometric pooling compares in equation 5: centroid and normal, F x 6.

    These terms of equation 2 rotate with the mesh, so that distances between them do not change.
    The other terms take absolute values per component: a rotation would change their distances, and
    with them the faces that collapse.
    """
    centroids, normals = _centroids_and_normals(geometry)
    features = np.empty((len(centroids), 6), np.float32)
    for f in range(len(centroids)):
        for k in range(3):
            features[f, k] = centroids[f, k]
            features[f, 3 + k] = normals[f, k]
    return features


@kernel
def _face_axes(
    vertices: NDArray[np.float64],
    faces: NDArray[np.int32],
    f: int,
    centroid: Vector,
    normal: Vector,
) -> tuple[Vector, Vector, Vector]:
    """A face's own axes: normal, away from the mesh's centre, and across both.

    Where the normal itself points away from the centre, the second axis points to the farthest
    corner instead. No rotation of the mesh changes a component along these axes.
    """
    tangent = _in_plane(centroid, normal)
    if length(tangent) < SHORTEST_TANGENT:
        farthest = (0.0, 0.0, 0.0)
        for s in range(3):
            offset = subtract(row(vertices, faces[f, s]), centroid)
            if dot(offset, offset) > dot(farthest, farthest):
                farthest = offset
        tangent = _in_plane(farthest, normal)
    tangent = scale(tangent, 1 / max(length(tangent), SHORTEST_TANGENT))
    return normal, tangent, cross(normal, tangent)


@kernel
def _in_plane(direction: Vector, normal: Vector) -> Vector:
    """A direction's part in the plane of a face."""
    return subtract(direction, scale(normal, dot(direction, normal)))


@kernel
def _apex(faces: NDArray[np.int32], half_edge: int) -> int:
    """The vertex of a half-edge's face that is not on it."""
    return faces[half_edge // 3, (half_edge % 3 + 2) % 3]


@kernel
def _centroids_and_normals(
    geometry: FaceGeometry,
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """F x 3 each; the normal is zero where a face has no area."""
    normals = np.zeros_like(geometry.crosses)
    for f in range(len(normals)):
        if geometry.doubles[f] > 0:
            write(normals, f, scale(row(geometry.crosses, f), 1 / geometry.doubles[f]))
    return geometry.corner_sums * (1 / 3), normals


@kernel
def _average_normals(
    normals: NDArray[np.float64], faces: NDArray[np.int32], vertex_count: int
) -> NDArray[np.float64]:
    """Mean of the face normals around every vertex: V x 3."""
    means = np.zeros((vertex_count, 3))
    around = np.zeros(vertex_count, np.int32)
    for f in range(len(faces)):
        for s in range(3):
            v = faces[f, s]
            around[v] += 1
            write(means, v, add(row(means, v), row(normals, f)))
    for v in range(vertex_count):
        write(means, v, scale(row(means, v), 1 / max(around[v], 1)))
    return means


@kernel
def _magnitudes(a: Vector) -> Vector:
    return abs(a[0]), abs(a[1]), abs(a[2])


@kernel
def _along(axes: tuple[Vector, Vector, Vector], a: Vector) -> Vector:
    """Components along three axes."""
    return dot(axes[0], a), dot(axes[1], a), dot(axes[2], a)
