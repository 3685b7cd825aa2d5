"""The fixed geometric terms under the learned descriptors (paper, equations 1 and 2)."""

import numpy as np
from numpy.typing import NDArray

from meshconv3d.model.jit import kernel

# Seven 3-vectors for each face: the first three are equation 1's, the last four equation 2's.
GEODESIC_TERMS = ("corner offsets", "corner normals", "apex edge differences")
GEOMETRIC_TERMS = ("centroid", "normal", "centroid differences", "normal cross products")

# In radii of the unit sphere. A shorter vector points nowhere in particular.
SHORTEST_TANGENT = 1e-3

Vector = tuple[float, float, float]


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
    centroids, normals = _measure_faces(vertices, faces)
    vertex_normals = _average_normals(normals, faces, len(vertices))
    terms = np.empty((7 * len(faces), 3), np.float32)
    axes = ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))
    for f in range(len(faces)):
        centroid, normal = _row(centroids, f), _row(normals, f)
        if face_axes:
            axes = _face_axes(vertices, faces, f, centroid, normal)
        offsets = corner_normals = apex_differences = (0.0, 0.0, 0.0)
        centroid_differences = normal_products = (0.0, 0.0, 0.0)
        for s in range(3):
            offset = _along(axes, _subtract(_row(vertices, faces[f, s]), centroid))
            offsets = _add(offsets, _magnitudes(offset) if absolute_offsets else offset)
            corner_normals = _add(corner_normals, _row(vertex_normals, faces[f, s]))
            t, before = twin[3 * f + s], twin[3 * f + (s + 2) % 3]
            if t >= 0:
                step = _subtract(centroid, _row(centroids, t // 3))
                centroid_differences = _add(centroid_differences, _magnitudes(_along(axes, step)))
                product = _cross(normal, _row(normals, t // 3))
                normal_products = _add(normal_products, _magnitudes(_along(axes, product)))
            if t >= 0 and before >= 0:
                # Corner s lies between side s and the side before it. Both edges start at the
                # corner, so that their difference is that of the apexes.
                step = _subtract(
                    _row(vertices, _apex(faces, t)), _row(vertices, _apex(faces, before))
                )
                apex_differences = _add(apex_differences, _magnitudes(_along(axes, step)))
        _write(terms, 7 * f, offsets)
        _write(terms, 7 * f + 1, _along(axes, corner_normals))
        _write(terms, 7 * f + 2, apex_differences)
        _write(terms, 7 * f + 3, _along(axes, centroid))
        _write(terms, 7 * f + 4, _along(axes, normal))
        _write(terms, 7 * f + 5, centroid_differences)
        _write(terms, 7 * f + 6, normal_products)
    return terms.reshape(len(faces), 7, 3)


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
    features = np.empty((len(faces), 6), np.float32)
    for f in range(len(faces)):
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
    if _length(tangent) < SHORTEST_TANGENT:
        farthest = (0.0, 0.0, 0.0)
        for s in range(3):
            offset = _subtract(_row(vertices, faces[f, s]), centroid)
            if _dot(offset, offset) > _dot(farthest, farthest):
                farthest = offset
        tangent = _in_plane(farthest, normal)
    tangent = _scale(tangent, 1 / max(_length(tangent), SHORTEST_TANGENT))
    return normal, tangent, _cross(normal, tangent)


@kernel
def _in_plane(direction: Vector, normal: Vector) -> Vector:
    """A direction's part in the plane of a face."""
    return _subtract(direction, _scale(normal, _dot(direction, normal)))


@kernel
def _apex(faces: NDArray[np.int32], half_edge: int) -> int:
    """The vertex of a half-edge's face that is not on it."""
    return faces[half_edge // 3, (half_edge % 3 + 2) % 3]


@kernel
def _measure_faces(
    vertices: NDArray[np.float64], faces: NDArray[np.int32]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Centroids and unit normals, F x 3 each; the normal is zero where a face has no area."""
    centroids = np.zeros((len(faces), 3))
    normals = np.zeros((len(faces), 3))
    for f in range(len(faces)):
        a, b, c = (
            _row(vertices, faces[f, 0]),
            _row(vertices, faces[f, 1]),
            _row(vertices, faces[f, 2]),
        )
        _write(centroids, f, _scale(_add(_add(a, b), c), 1 / 3))
        across = _cross(_subtract(b, a), _subtract(c, a))
        length = _length(across)
        if length > 0:
            _write(normals, f, _scale(across, 1 / length))
    return centroids, normals


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
            _write(means, v, _add(_row(means, v), _row(normals, f)))
    for v in range(vertex_count):
        _write(means, v, _scale(_row(means, v), 1 / max(around[v], 1)))
    return means


# 3-vectors are tuples here: they stay in registers, where an array would be allocated.


@kernel
def _row(table: NDArray, i: int) -> Vector:
    return table[i, 0], table[i, 1], table[i, 2]


@kernel
def _write(table: NDArray, i: int, a: Vector) -> None:
    table[i, 0], table[i, 1], table[i, 2] = a


@kernel
def _add(a: Vector, b: Vector) -> Vector:
    return a[0] + b[0], a[1] + b[1], a[2] + b[2]


@kernel
def _subtract(a: Vector, b: Vector) -> Vector:
    return a[0] - b[0], a[1] - b[1], a[2] - b[2]


@kernel
def _scale(a: Vector, factor: float) -> Vector:
    return a[0] * factor, a[1] * factor, a[2] * factor


@kernel
def _dot(a: Vector, b: Vector) -> float:
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


@kernel
def _cross(a: Vector, b: Vector) -> Vector:
    return a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]


@kernel
def _length(a: Vector) -> float:
    return np.sqrt(_dot(a, a))


@kernel
def _magnitudes(a: Vector) -> Vector:
    return abs(a[0]), abs(a[1]), abs(a[2])


@kernel
def _along(axes: tuple[Vector, Vector, Vector], a: Vector) -> Vector:
    """Components along three axes."""
    return _dot(axes[0], a), _dot(axes[1], a), _dot(axes[2], a)
