"""Points drawn from a surface."""

import numpy as np
from numpy.typing import NDArray


def sample_surface(
    vertices: NDArray[np.float64], faces: NDArray[np.int32], count: int, rng: np.random.Generator
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Independent uniform points and the unit normals of their faces, count x 3 each.

    The points are centred on their mean and have a root mean square radius of 1: unlike the
    farthest vertex, that does not hang on one thin part.
    """
    a, b, c = vertices[faces].transpose(1, 0, 2)
    crosses = np.cross(b - a, c - a)
    twice_areas = np.linalg.norm(crosses, axis=1)
    ends = np.cumsum(twice_areas)
    # Faces without area end where the one before does and are never hit.
    chosen = np.searchsorted(ends, rng.random(count) * ends[-1], side="right")
    chosen = np.minimum(chosen, len(faces) - 1)
    u, v = rng.random((2, count, 1))
    root = np.sqrt(u)
    points = (1 - root) * a[chosen] + root * ((1 - v) * b[chosen] + v * c[chosen])
    points -= points.mean(axis=0)
    points /= np.sqrt((points**2).sum(axis=1).mean())
    return points, crosses[chosen] / np.maximum(twice_areas[chosen], np.finfo(float).tiny)[:, None]
