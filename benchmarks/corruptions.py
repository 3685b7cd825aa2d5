"""Changes of meshes that a classifier should not mind: what scanners, modellers and exporters do.

Each takes a mesh and a generator, and returns another mesh of the same thing. `FILES` change a mesh
as it is in its file, `SHAPES` a prepared one, which is sound. `benchmarks.robustness` uses them.
"""

from collections.abc import Callable

import numpy as np
import trimesh
from scipy import ndimage
from scipy.cluster.vq import kmeans2
from skimage.measure import marching_cubes

from meshconv3d.model.mesh import Mesh
from meshconv3d.model.training import variation
from meshconv3d.model.training.augmentation import random_rotation

Change = Callable[[Mesh, np.random.Generator], Mesh]


def join(meshes: list[Mesh]) -> Mesh:
    """All meshes as one."""
    starts = np.cumsum([0, *(len(mesh.vertices) for mesh in meshes)])
    faces = [mesh.faces + start for mesh, start in zip(meshes, starts, strict=False)]
    return Mesh(np.concatenate([mesh.vertices for mesh in meshes]), np.concatenate(faces))


def as_soup(mesh: Mesh) -> Mesh:
    """Three vertices of its own for every face, as in STL."""
    return Mesh(mesh.vertices[mesh.faces].reshape(-1, 3), np.arange(mesh.faces.size).reshape(-1, 3))


def with_ball(mesh: Mesh, rng: np.random.Generator) -> Mesh:
    """A small ball beside it: 3 % of the diagonal in radius."""
    ball = trimesh.creation.icosphere(subdivisions=1, radius=0.03 * variation.diagonal(mesh))
    return join([mesh, Mesh(ball.vertices + _place_beside(mesh, rng), ball.faces)])


def with_specks(mesh: Mesh, count: int, rng: np.random.Generator) -> Mesh:
    """Tetrahedra beside it, 0.2 % of the diagonal in radius."""
    corners = np.array([[1, 1, 1], [1, -1, -1], [-1, 1, -1], [-1, -1, 1]]) / np.sqrt(3)
    faces = np.array([[0, 1, 2], [0, 3, 1], [0, 2, 3], [1, 3, 2]])
    speck = 0.002 * variation.diagonal(mesh) * corners
    return join([mesh, *(Mesh(speck + _place_beside(mesh, rng), faces) for _ in range(count))])


def _place_beside(mesh: Mesh, rng: np.random.Generator) -> np.ndarray:
    vertex = mesh.vertices[rng.integers(len(mesh.vertices))]
    return vertex + rng.normal(0, 0.1 * variation.diagonal(mesh), 3)


def on_a_floor(mesh: Mesh) -> Mesh:
    """A thin square plate below it, a tenth wider than the mesh."""
    low, high = mesh.vertices.min(axis=0), mesh.vertices.max(axis=0)
    width, height = 1.1 * (high - low)[:2].max(), 0.01 * variation.diagonal(mesh)
    plate = trimesh.creation.box((width, width, height))
    middle = np.append((low + high)[:2] / 2, low[2] - height / 2)
    return join([mesh, Mesh(plate.vertices + middle, plate.faces)])


def doubled(mesh: Mesh) -> Mesh:
    """Every face twice, the second time wound the other way."""
    return Mesh(mesh.vertices, np.concatenate([mesh.faces, mesh.faces[:, ::-1]]))


def scanned(mesh: Mesh, rng: np.random.Generator) -> Mesh:
    """One side of it: the faces turned towards a random direction."""
    a, b, c = (mesh.vertices[corner] for corner in mesh.faces.T)
    facing = np.cross(b - a, c - a) @ random_rotation(rng)[0]
    return Mesh(mesh.vertices, mesh.faces[facing > 0])


def with_holes(mesh: Mesh, share: float, count: int, rng: np.random.Generator) -> Mesh:
    """Several holes, each an equal part of a share of the faces."""
    size = share * len(mesh.faces) / count
    for _ in range(count):
        mesh = variation.cut(mesh, size / len(mesh.faces), rng)
    return mesh


def stretched(mesh: Mesh, share: float, rng: np.random.Generator) -> Mesh:
    """Longer along one random direction."""
    axis = random_rotation(rng)[0]
    return mesh.moved(mesh.vertices + share * np.outer(mesh.vertices @ axis, axis))


def isotropic(mesh: Mesh, rng: np.random.Generator) -> Mesh:
    """Near-equilateral triangles around 250 means of the vertices of a fine subdivision.

    As in Valette and Chassery, *Approximated centroidal Voronoi diagrams for uniform polygonal mesh
    coarsening* (2004), with clusters in space: three that meet in a triangle are a face.
    """
    fine = mesh
    while len(fine.vertices) < 4000:
        fine = variation.subdivided(fine)
    centres, cluster = kmeans2(fine.vertices, 250, minit="++", rng=rng)
    faces = cluster[fine.faces]
    faces = faces[(faces != np.roll(faces, 1, axis=1)).all(axis=1)]
    _, first = np.unique(np.sort(faces, axis=1), axis=0, return_index=True)
    return Mesh(centres, faces[first])


def voxelised(mesh: Mesh, resolution: int = 48) -> Mesh:
    """Marching cubes over filled voxels, `resolution` along the longest side, blurred by one."""
    size = np.ptp(mesh.vertices, axis=0).max() / resolution
    low = mesh.vertices.min(axis=0) - 3 * size
    fine = trimesh.remesh.subdivide_to_size(mesh.vertices, mesh.faces, size, max_iter=20)[0]
    cells = np.floor((fine - low) / size).astype(int)
    grid = np.zeros(cells.max(axis=0) + 4, bool)
    grid[tuple(cells.T)] = True
    solid = ndimage.gaussian_filter(np.asarray(ndimage.binary_fill_holes(grid), float), 1)
    vertices, faces, _, _ = marching_cubes(solid, min(0.5, 0.9 * solid.max()))
    return Mesh(low + (vertices + 0.5) * size, faces)


FILES: dict[str, Change] = {
    "rotated at random": lambda mesh, rng: mesh.moved(mesh.vertices @ random_rotation(rng).T),
    "winding inverted": lambda mesh, rng: Mesh(mesh.vertices, mesh.faces[:, ::-1]),
    "triangle soup": lambda mesh, rng: as_soup(mesh),
    "every face twice": lambda mesh, rng: doubled(mesh),
    "a speck": lambda mesh, rng: with_specks(mesh, 1, rng),
    "ten specks": lambda mesh, rng: with_specks(mesh, 10, rng),
    "a floor plate": lambda mesh, rng: on_a_floor(mesh),
}
SHAPES: dict[str, Change] = {
    "subdivided with jitter": variation.retriangulated,
    "two Loop subdivisions": lambda mesh, rng: variation.smoothed(mesh, 2),
    "250 faces": lambda mesh, rng: variation.with_faces(mesh, 250),
    "1000 faces": lambda mesh, rng: variation.with_faces(mesh, 1000),
    "20 000 faces": lambda mesh, rng: variation.with_faces(mesh, 20_000),
    "flattest 30 % of edges flipped": lambda mesh, rng: variation.flipped(mesh, 0.3),
    "isotropic remeshing": isotropic,
    "marching cubes": lambda mesh, rng: voxelised(mesh),
    "noise, 0.5 % of the diagonal": lambda mesh, rng: variation.noisy(mesh, 0.005, rng),
    "noise, 1 % of the diagonal": lambda mesh, rng: variation.noisy(mesh, 0.01, rng),
    "noise, 2 % of the diagonal": lambda mesh, rng: variation.noisy(mesh, 0.02, rng),
    "stretched by 30 %": lambda mesh, rng: stretched(mesh, 0.3, rng),
    "5 % of the faces cut out": lambda mesh, rng: variation.cut(mesh, 0.05, rng),
    "10 % of the faces cut out": lambda mesh, rng: variation.cut(mesh, 0.1, rng),
    "20 % of the faces in five holes": lambda mesh, rng: with_holes(mesh, 0.2, 5, rng),
    "scanned from one side": scanned,
    "a small ball beside it": with_ball,
}
