"""A mesh in axes of its own, so that how it was laid down in its file changes nothing.

The axes are the principal ones of the surface: those of its second moment, widest first. Each
points to where the surface's third moment is positive, and the last completes a right-handed
frame. Moments are exact integrals over the triangles: cutting a triangle changes none.
"""

import numpy as np
from numpy.typing import NDArray

from model.kernels import kernel

# No turn, and the half-turns about each axis: all ways to point right-handed axes.
FLIPS = np.array([[1, 1, 1], [1, -1, -1], [-1, 1, -1], [-1, -1, 1]])


def into_principal_axes(
    vertices: NDArray[np.float64],
    faces: NDArray[np.int32],
    wobble: NDArray[np.float64] | float = 0.0,
) -> NDArray[np.float64]:
    """Turn a centred mesh into its principal axes: V x 3.

    wobble: symmetric 3 x 3, added to the second moment in shares of its trace. It turns axes that
    are nearly alike freely, and clear ones hardly.
    """
    second, third = surface_moments(vertices, faces)
    _, axes = np.linalg.eigh(second / np.trace(second) + wobble)
    axes = axes[:, ::-1]
    for column in (0, 1):
        if third @ axes[:, column] @ axes[:, column] @ axes[:, column] < 0:
            axes[:, column] *= -1
    axes[:, 2] = np.cross(axes[:, 0], axes[:, 1])
    return vertices @ axes


@kernel
def surface_moments(
    vertices: NDArray[np.float64], faces: NDArray[np.int32]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Second (3 x 3) and third (3 x 3 x 3) moment of a surface, each up to a constant factor."""
    second = np.zeros((3, 3))
    third = np.zeros((3, 3, 3))
    for f in range(len(faces)):
        a, b, c = vertices[faces[f, 0]], vertices[faces[f, 1]], vertices[faces[f, 2]]
        s = a + b + c
        squares = 0.0
        for k in range(3):
            i, j = (k + 1) % 3, (k + 2) % 3
            squares += ((b[i] - a[i]) * (c[j] - a[j]) - (b[j] - a[j]) * (c[i] - a[i])) ** 2
        area = np.sqrt(squares)
        for i in range(3):
            for j in range(3):
                pairs = a[i] * a[j] + b[i] * b[j] + c[i] * c[j]
                second[i, j] += area * (pairs + s[i] * s[j])
                for k in range(3):
                    mixed = s[i] * (a[j] * a[k] + b[j] * b[k] + c[j] * c[k])
                    mixed += s[j] * (a[i] * a[k] + b[i] * b[k] + c[i] * c[k])
                    mixed += s[k] * pairs + s[i] * s[j] * s[k]
                    cubes = a[i] * a[j] * a[k] + b[i] * b[j] * b[k] + c[i] * c[j] * c[k]
                    third[i, j, k] += area * (mixed + 2 * cubes)
    return second, third
