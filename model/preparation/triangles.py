"""What is measured of triangles, in compiled loops: for 500 faces, NumPy's calls cost more than
its arithmetic. The order of additions is NumPy's, so that both give the same bits.
"""

import numpy as np
from numpy.typing import NDArray

from meshconv3d.model.jit import kernel


@kernel
def measure_faces(
    vertices: NDArray[np.float64], faces: NDArray[np.int32]
) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
    """(centroids F x 3, area normals F x 3, areas F) of triangles.

    An area normal is as long as the face's area is large, in the square of the vertices' unit.
    """
    centroids = np.empty((len(faces), 3))
    area_normals = np.empty((len(faces), 3))
    areas = np.empty(len(faces))
    for f in range(len(faces)):
        a, b, c = faces[f, 0], faces[f, 1], faces[f, 2]
        for k in range(3):
            centroids[f, k] = (vertices[a, k] + vertices[b, k] + vertices[c, k]) / 3
            i, j = (k + 1) % 3, (k + 2) % 3
            area_normals[f, k] = (
                (vertices[b, i] - vertices[a, i]) * (vertices[c, j] - vertices[a, j])
                - (vertices[b, j] - vertices[a, j]) * (vertices[c, i] - vertices[a, i])
            ) / 2
        x, y, z = area_normals[f, 0], area_normals[f, 1], area_normals[f, 2]
        areas[f] = np.sqrt(x * x + y * y + z * z)
    return centroids, area_normals, areas


def surface_area(vertices: NDArray[np.float64], faces: NDArray[np.int32]) -> float:
    """Total area of the triangles, in the square of the vertices' unit."""
    return float(face_areas(vertices, faces).sum())


def face_areas(vertices: NDArray[np.float64], faces: NDArray[np.int32]) -> NDArray[np.float64]:
    """Area of each triangle, F float64, in the square of the vertices' unit."""
    return measure_faces(vertices, faces)[2]


def weighted_mean(points: NDArray[np.float64], weights: NDArray[np.float64]) -> NDArray[np.float64]:
    """Mean of points (N x 3) by weight (N): 3 float64."""
    return (points * weights[:, None]).sum(axis=0) / weights.sum()


@kernel
def have_height(
    vertices: NDArray[np.float64],
    faces: NDArray[np.int32],
    areas: NDArray[np.float64],
    flatness: float,
) -> NDArray[np.bool_]:
    """Which triangles (F) have more than `flatness` of the area that their longest side allows."""
    sound = np.empty(len(faces), np.bool_)
    for f in range(len(faces)):
        longest = 0.0
        for s in range(3):
            u, v = faces[f, s], faces[f, (s + 1) % 3]
            square = 0.0
            for k in range(3):
                step = vertices[u, k] - vertices[v, k]
                square += step * step
            longest = max(longest, square)
        sound[f] = 2 * areas[f] > flatness * longest
    return sound


@kernel
def enclose(
    component: NDArray[np.int32],
    count: int,
    centroids: NDArray[np.float64],
    area_normals: NDArray[np.float64],
    areas: NDArray[np.float64],
    middle: NDArray[np.float64],
) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
    """Area of each of `count` components, and the volumes that it spans with its own centre and
    with `middle`: negative where it faces inward.

    component: F int32, of every face; the others: of every face, as `measure_faces` has them.
    """
    total = np.zeros(count)
    centres = np.zeros((count, 3))
    for f in range(len(component)):
        total[component[f]] += areas[f]
        for k in range(3):
            centres[component[f], k] += areas[f] * centroids[f, k]
    for part in range(count):
        for k in range(3):
            centres[part, k] /= total[part]
    own = np.zeros(count)
    common = np.zeros(count)
    for f in range(len(component)):
        part = component[f]
        height = 0.0
        height_common = 0.0
        for k in range(3):
            height += (centroids[f, k] - centres[part, k]) * area_normals[f, k]
            height_common += (centroids[f, k] - middle[k]) * area_normals[f, k]
        own[part] += height
        common[part] += height_common
    return total, own / 3, common / 3


@kernel
def bounds(
    vertices: NDArray[np.float64], faces: NDArray[np.int32]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Lowest and highest coordinates of all corners, 3 float64 each."""
    low = np.full(3, np.inf)
    high = np.full(3, -np.inf)
    for f in range(len(faces)):
        for s in range(3):
            for k in range(3):
                value = vertices[faces[f, s], k]
                low[k] = min(low[k], value)
                high[k] = max(high[k], value)
    return low, high


@kernel
def farthest(vertices: NDArray[np.float64], centre: NDArray[np.float64]) -> float:
    """Distance of the farthest vertex from a point."""
    most = 0.0
    for v in range(len(vertices)):
        square = 0.0
        for k in range(3):
            step = vertices[v, k] - centre[k]
            square += step * step
        most = max(most, square)
    return np.sqrt(most)
