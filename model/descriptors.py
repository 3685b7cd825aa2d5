"""The fixed geometric terms under the learned descriptors (paper, equations 1 and 2)."""

import numpy as np
from numpy.typing import NDArray

from model.kernels import kernel

# Seven 3-vectors for each face: the first three are equation 1's, the last four equation 2's.
GEODESIC_TERMS = ("corner offsets", "corner normals", "apex edge differences")
GEOMETRIC_TERMS = ("centroid", "normal", "centroid differences", "normal cross products")


@kernel
def descriptor_terms(
    vertices: NDArray[np.float64],
    faces: NDArray[np.int32],
    twin: NDArray[np.int32],
    absolute_offsets: bool,
) -> NDArray[np.float32]:
    """The 3-vectors of equations 1 and 2 for every face: F x D x 3 float32, D = 7.

    vertices: V x 3 float64. faces: F x 3 int32. twin: H int32, see `find_twins`.
    In order, with corners v_i, centroid c, unit normal n, corner normals n_i (the mean normal of
    the faces around the corner's vertex), neighbours j, and |.| per component:

        0  sum_i (v_i - c), identically zero; with absolute_offsets, sum_i |v_i - c|
        1  sum_i n_i
        2  sum_i |e_i1 - e_i2|, edges from corner i to the apexes of the two neighbours there
        3  c
        4  n
        5  sum_j |c - c_j|
        6  sum_j |n x n_j|

    A missing neighbour adds nothing; so does a corner with only one neighbour to its term in 2.
    The normal of a face without area is zero.
    """
    count = len(faces)
    centroids = np.zeros((count, 3))
    normals = np.zeros((count, 3))
    for f in range(count):
        _measure_face(vertices, faces[f], centroids[f], normals[f])
    vertex_normals = _average_normals(normals, faces, len(vertices))
    terms = np.zeros((count, 7, 3), np.float32)
    row = np.empty((7, 3))
    apexes = np.empty(3, np.int32)
    for f in range(count):
        row[:] = 0.0
        for s in range(3):
            t = twin[3 * f + s]
            apexes[s] = -1 if t < 0 else faces[t // 3, (t % 3 + 2) % 3]
        for k in range(3):
            row[3, k] = centroids[f, k]
            row[4, k] = normals[f, k]
            for s in range(3):
                corner = faces[f, s]
                offset = vertices[corner, k] - centroids[f, k]
                row[0, k] += abs(offset) if absolute_offsets else offset
                row[1, k] += vertex_normals[corner, k]
                # Corner s lies between side s and the side before it. Both edges start at the
                # corner, so that their difference is that of the apexes.
                one, other = apexes[s], apexes[(s + 2) % 3]
                if one >= 0 and other >= 0:
                    row[2, k] += abs(vertices[one, k] - vertices[other, k])
        for s in range(3):
            t = twin[3 * f + s]
            if t < 0:
                continue
            g = t // 3
            for k in range(3):
                i, j = (k + 1) % 3, (k + 2) % 3
                row[5, k] += abs(centroids[f, k] - centroids[g, k])
                row[6, k] += abs(normals[f, i] * normals[g, j] - normals[f, j] * normals[g, i])
        terms[f] = row
    return terms


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


def pooling_features(terms: NDArray[np.float32]) -> NDArray[np.float32]:
    """What the `geometric` reading of equation 5 compares: centroid and normal, F x 6.

    They are equation 2's terms that turn with the mesh. The others take absolute values per
    component: a rotation would change their distances, and with them the faces that collapse.
    """
    return np.ascontiguousarray(terms[:, 3:5].reshape(len(terms), 6))
