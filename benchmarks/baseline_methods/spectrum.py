"""No learning at all: the nearest neighbour by Laplace-Beltrami eigenvalues (Shape-DNA).

Reuter, Wolter and Peinecke, "Laplace-Beltrami spectra as Shape-DNA of surfaces and solids", 2006.
"""

from dataclasses import dataclass

import numpy as np
import robust_laplacian
from numpy.typing import NDArray
from scipy import sparse
from scipy.linalg import eigvalsh
from scipy.sparse.csgraph import connected_components
from scipy.spatial.distance import cdist

from benchmarks.baseline_methods.data import Part
from meshconv3d.model.mesh import Mesh
from meshconv3d.model.preparation import surface_area


@dataclass(frozen=True)
class Spectrum:
    """Scores a class by the nearest of its training meshes.

    count: eigenvalues compared, the zeros left out: every part of a mesh has one, and a mesh of
    24 parts would have nothing else.
    """

    count: int = 24

    def scores(self, train: Part, test: Part, seed: int) -> NDArray[np.float64]:
        """Minus the distance to each class's nearest training mesh, N x N_c. Nothing is random."""
        distances = cdist(self._features(test.meshes), self._features(train.meshes))
        members = [distances[:, train.labels == label] for label in range(train.classes)]
        # A class without a usable mesh is farther than any other, but not infinitely.
        most = distances.max() + 1
        return -np.stack([columns.min(axis=1, initial=most) for columns in members], axis=1)

    def _features(self, meshes: list[Mesh]) -> NDArray[np.float64]:
        return np.stack([log_spectrum(mesh, self.count) for mesh in meshes])


def log_spectrum(mesh: Mesh, count: int) -> NDArray[np.float64]:
    """Logarithms of the first `count` eigenvalues but the zeros, times the area: scale-free.

    In logarithms a difference is a ratio, so that the high eigenvalues do not outweigh the low.
    """
    return np.log(eigenvalues(mesh, count) * surface_area(mesh.vertices, mesh.faces))


def eigenvalues(mesh: Mesh, count: int) -> NDArray[np.float64]:
    """The smallest positive eigenvalues of the Laplacian with lumped mass, ascending: `count`.

    A mesh with fewer repeats its last. The Laplacian is the tufted one of Sharp and Crane, which
    is the cotangent one where that is Delaunay, and finite where triangles are slivers.
    """
    laplacian, mass = robust_laplacian.mesh_laplacian(mesh.vertices, mesh.faces)
    half = sparse.diags_array(1 / np.sqrt(mass.diagonal()))
    operator = (half @ laplacian @ half).tocsr()
    # Part by part and dense: each is small, each has exactly one zero, and an iterative solver
    # would depend on its start and lose count of equal eigenvalues.
    parts = [_part_eigenvalues(block, count) for block in _blocks(operator)]
    smallest = np.sort(np.concatenate(parts))[:count]
    return np.pad(smallest, (0, count - len(smallest)), mode="edge")


def _blocks(operator: sparse.csr_array) -> list[NDArray[np.float64]]:
    """The diagonal blocks of the connected components, dense."""
    _, component = connected_components(operator, directed=False)
    members = np.split(np.argsort(component, kind="stable"), np.cumsum(np.bincount(component))[:-1])
    return [operator[rows][:, rows].toarray() for rows in members]


def _part_eigenvalues(block: NDArray[np.float64], count: int) -> NDArray[np.float64]:
    """All but the first, which is zero, up to `count` of them."""
    last = min(count, len(block) - 1)
    return eigvalsh((block + block.T) / 2, subset_by_index=(0, last))[1:]
