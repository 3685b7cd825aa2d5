"""Chirality: numbers that tell a shape from its mirror image."""

from itertools import combinations

import numpy as np
from numpy.typing import NDArray

from meshconv3d.model.mesh import Mesh
from meshconv3d.model.topology.geometry import face_areas

# Vectors shorter than this, of shapes with symmetries, are mostly noise.
LEAST_LENGTH = 1e-3
# How near the chirality of one mesh must be to the opposite of the other's.
OPPOSITE = 0.2


def chirality(mesh: Mesh) -> NDArray[np.float64]:
    """Twenty numbers of a surface, which its mirror image has with the other sign.

    With p the points of the surface relative to its centroid, over their root mean square length,
    r these lengths, and M the mean of p p^T: the means of p / r, r p and r^3 p, and each of them
    times M, are six vectors that turn with the surface. The numbers are the determinants of every
    three of them, each over its length. They do not change with rotation, position or scale, and
    are near zero for shapes that have a plane of symmetry.
    """
    areas = face_areas(mesh.vertices, mesh.faces)
    shares = areas / areas.sum()
    points = mesh.vertices[mesh.faces].mean(axis=1)
    points = points - shares @ points
    lengths = np.linalg.norm(points, axis=1)
    scale = np.sqrt(shares @ lengths**2)
    points, lengths = points / scale, lengths / scale
    spread = (points * shares[:, None]).T @ points
    weights = (1 / np.maximum(lengths, 1e-9), lengths, lengths**3)
    vectors = [shares * weight @ points for weight in weights]
    vectors += [spread @ vector for vector in vectors]
    vectors = [vector / (LEAST_LENGTH + np.linalg.norm(vector)) for vector in vectors]
    return np.linalg.det(np.array(list(combinations(vectors, 3))))


def are_mirror_images(first: NDArray[np.float64], second: NDArray[np.float64]) -> bool:
    """Whether two meshes of one shape are mirror images, by their `chirality`.

    False where the shape is its own mirror image, as far as can be told.
    """
    return bool(np.linalg.norm(first + second) < OPPOSITE * np.linalg.norm(first - second))
