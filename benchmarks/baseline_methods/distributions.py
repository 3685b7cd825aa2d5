"""Shape distributions: how distances, angles, areas and volumes between random points spread.

Osada, Funkhouser, Chazelle and Dobkin, "Shape distributions", 2002; the pairs of points with
normals follow Wahl, Hillenbrand and Hirzinger, "Surflet-pair-relation histograms", 2003.
"""

import numpy as np
from numpy.typing import NDArray

from benchmarks.baseline_methods.surface_samples import sample_surface
from meshconv3d.model.mesh import Mesh

QUANTILES = (np.arange(16) + 0.5) / 16
# Of distances in units of the root mean square radius; a pair is 1.4 apart on average.
DISTANCE_EDGES = np.arange(1, 8) * 0.35
RADIUS_EDGES = (0.3, 0.6, 0.85, 1.1, 1.4, 1.8, 2.4)
COSINE_BINS = 6


def shape_distributions(
    mesh: Mesh, count: int, rng: np.random.Generator
) -> dict[str, NDArray[np.float64]]:
    """Every distribution by name, of `count` random tuples of points.

    D1 (point to centroid), D2 (two points), A3 (angle at a point), D3 (square root of a
    triangle's area) and D4 (cube root of a tetrahedron's volume) as 16 quantiles. Cosines between
    normals and lines, by distance, as 8 x 6 shares; absolute ones, since the normals of an open
    mesh may point either way.
    """
    points, normals = sample_surface(mesh.vertices, mesh.faces, count, rng)
    # Four orders of one sample make tuples of independent points.
    second, third, fourth = (rng.permutation(count) for _ in range(3))
    radii = _lengths(points)
    ab, ac, ad = (points[other] - points for other in (second, third, fourth))
    across = np.cross(ab, ac)
    lengths = {
        "D1": radii,
        "D2": _lengths(ab),
        "A3": np.arctan2(_lengths(across), _dot(ab, ac)),
        "D3": np.sqrt(_lengths(across)),
        "D4": np.cbrt(np.abs(_dot(across, ad))),
    }
    apart = np.searchsorted(DISTANCE_EDGES, lengths["D2"])
    away = np.searchsorted(RADIUS_EDGES, radii)
    cosines = {
        "normal to normal": (apart, _dot(normals, normals[second])),
        "normal to line": (apart, _over(_dot(normals, ab), lengths["D2"])),
        "normal to centroid": (away, _over(_dot(normals, points), radii)),
    }
    quantiles = {name: np.quantile(values, QUANTILES) for name, values in lengths.items()}
    return quantiles | {name: _joint(*pair) for name, pair in cosines.items()}


def _joint(distance_bins: NDArray[np.int64], cosines: NDArray[np.float64]) -> NDArray[np.float64]:
    """Shares of pairs by distance and absolute cosine, 48."""
    cosine_bins = np.minimum((np.abs(cosines) * COSINE_BINS).astype(int), COSINE_BINS - 1)
    bins = distance_bins * COSINE_BINS + cosine_bins
    return np.bincount(bins, minlength=8 * COSINE_BINS) / len(bins)


def _dot(a: NDArray[np.float64], b: NDArray[np.float64]) -> NDArray[np.float64]:
    return np.einsum("nk,nk->n", a, b)


def _lengths(vectors: NDArray[np.float64]) -> NDArray[np.float64]:
    return np.linalg.norm(vectors, axis=1)


def _over(a: NDArray[np.float64], b: NDArray[np.float64]) -> NDArray[np.float64]:
    """a / b, and zero where b is: a point paired with itself."""
    return np.divide(a, b, out=np.zeros_like(a), where=b > 0)
