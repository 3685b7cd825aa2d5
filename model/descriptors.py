"""The fixed geometric terms under the learned descriptors (paper, equations 1 and 2)."""

import numpy as np
from numpy.typing import NDArray

from model.kernels import kernel

# Seven 3-vectors for each face: the first three are equation 1's, the last four equation 2's.
GEODESIC_TERMS = ("corner offsets", "corner normals", "apex edge differences")
GEOMETRIC_TERMS = ("centroid", "normal", "centroid differences", "normal cross products")

# In radii of the unit sphere. A shorter vector points nowhere in particular.
SHORTEST_TANGENT = 1e-3


@kernel
def descriptor_terms(
    vertices: NDArray[np.float64],
    faces: NDArray[np.int32],
    twin: NDArray[np.int32],
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
    count = len(faces)
    centroids, normals = _measure_faces(vertices, faces)
    vertex_normals = _average_normals(normals, faces, len(vertices))
    terms = np.zeros((count, 7, 3), np.float32)
    row = np.empty((7, 3))
    axes = np.eye(3)
    step = np.empty(3)
    apexes = np.empty(3, np.int32)
    for f in range(count):
        if face_axes:
            _face_axes(vertices, faces[f], centroids[f], normals[f], axes)
        row[:] = 0.0
        _add_components(axes, centroids[f], row[3])
        _add_components(axes, normals[f], row[4])
        for s in range(3):
            corner = faces[f, s]
            step[:] = vertices[corner] - centroids[f]
            if absolute_offsets:
                _add_magnitudes(axes, step, row[0])
            else:
                _add_components(axes, step, row[0])
            _add_components(axes, vertex_normals[corner], row[1])
            t = twin[3 * f + s]
            apexes[s] = -1 if t < 0 else faces[t // 3, (t % 3 + 2) % 3]
            if t >= 0:
                g = t // 3
                step[:] = centroids[f] - centroids[g]
                _add_magnitudes(axes, step, row[5])
                _cross(normals[f], normals[g], step)
                _add_magnitudes(axes, step, row[6])
        for s in range(3):
            # Corner s lies between side s and the side before it. Both edges start at the corner,
            # so that their difference is that of the apexes.
            one, other = apexes[s], apexes[(s + 2) % 3]
            if one >= 0 and other >= 0:
                step[:] = vertices[one] - vertices[other]
                _add_magnitudes(axes, step, row[2])
        terms[f] = row
    return terms


@kernel
def pooling_features(
    vertices: NDArray[np.float64], faces: NDArray[np.int32]
) -> NDArray[np.float32]:
    """What the `geometric` reading of equation 5 compares: centroid and normal, F x 6.

    They are equation 2's terms that turn with the mesh, in axes that all faces share. The others
    take absolute values per component: a rotation would change their distances, and with them the
    faces that collapse.
    """
    centroids, normals = _measure_faces(vertices, faces)
    return np.concatenate((centroids, normals), axis=1).astype(np.float32)


@kernel
def _face_axes(
    vertices: NDArray[np.float64],
    face: NDArray[np.int32],
    centroid: NDArray[np.float64],
    normal: NDArray[np.float64],
    axes: NDArray[np.float64],
) -> None:
    """Write a face's own axes as rows: normal, away from the mesh's centre, and across both.

    Where the normal itself points away from the centre, the second axis points to the farthest
    corner instead. No rotation of the mesh changes a component along these axes.
    """
    axes[0] = normal
    if not _write_tangent(centroid, normal, axes[1]):
        farthest, most = 0, -1.0
        for s in range(3):
            distance = 0.0
            for k in range(3):
                distance += (vertices[face[s], k] - centroid[k]) ** 2
            if distance > most:
                farthest, most = s, distance
        _write_tangent(vertices[face[farthest]] - centroid, normal, axes[1])
    _cross(axes[0], axes[1], axes[2])


@kernel
def _write_tangent(
    direction: NDArray[np.float64], normal: NDArray[np.float64], tangent: NDArray[np.float64]
) -> bool:
    """The unit vector of a direction's part in the plane of a face; false where that is none."""
    upward = 0.0
    for k in range(3):
        upward += direction[k] * normal[k]
    square = 0.0
    for k in range(3):
        tangent[k] = direction[k] - upward * normal[k]
        square += tangent[k] ** 2
    length = np.sqrt(square)
    for k in range(3):
        tangent[k] /= max(length, SHORTEST_TANGENT)
    return length >= SHORTEST_TANGENT


@kernel
def _add_components(
    axes: NDArray[np.float64], vector: NDArray[np.float64], out: NDArray[np.float64]
) -> None:
    for k in range(3):
        out[k] += axes[k, 0] * vector[0] + axes[k, 1] * vector[1] + axes[k, 2] * vector[2]


@kernel
def _add_magnitudes(
    axes: NDArray[np.float64], vector: NDArray[np.float64], out: NDArray[np.float64]
) -> None:
    for k in range(3):
        out[k] += abs(axes[k, 0] * vector[0] + axes[k, 1] * vector[1] + axes[k, 2] * vector[2])


@kernel
def _cross(a: NDArray[np.float64], b: NDArray[np.float64], out: NDArray[np.float64]) -> None:
    for k in range(3):
        i, j = (k + 1) % 3, (k + 2) % 3
        out[k] = a[i] * b[j] - a[j] * b[i]


@kernel
def _measure_faces(
    vertices: NDArray[np.float64], faces: NDArray[np.int32]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Centroids and unit normals, F x 3 each; the normal is zero where a face has no area."""
    centroids = np.zeros((len(faces), 3))
    normals = np.zeros((len(faces), 3))
    for f in range(len(faces)):
        _measure_face(vertices, faces[f], centroids[f], normals[f])
    return centroids, normals


@kernel
def _measure_face(
    vertices: NDArray[np.float64],
    face: NDArray[np.int32],
    centroid: NDArray[np.float64],
    normal: NDArray[np.float64],
) -> None:
    """Write a face's centroid and unit normal, zero where the face has no area."""
    a, b, c = vertices[face[0]], vertices[face[1]], vertices[face[2]]
    for k in range(3):
        i, j = (k + 1) % 3, (k + 2) % 3
        centroid[k] = (a[k] + b[k] + c[k]) / 3
        normal[k] = (b[i] - a[i]) * (c[j] - a[j]) - (b[j] - a[j]) * (c[i] - a[i])
    length = np.sqrt(normal[0] ** 2 + normal[1] ** 2 + normal[2] ** 2)
    if length > 0:
        for k in range(3):
            normal[k] /= length


@kernel
def _average_normals(
    normals: NDArray[np.float64], faces: NDArray[np.int32], vertex_count: int
) -> NDArray[np.float64]:
    """Mean of the face normals around every vertex: V x 3."""
    sums = np.zeros((vertex_count, 3))
    around = np.zeros(vertex_count, np.int32)
    for f in range(len(faces)):
        for s in range(3):
            around[faces[f, s]] += 1
            for k in range(3):
                sums[faces[f, s], k] += normals[f, k]
    for v in range(vertex_count):
        for k in range(3):
            sums[v, k] /= max(around[v], 1)
    return sums
