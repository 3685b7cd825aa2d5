"""Varied copies of a mesh: other triangles, noise, holes.

Each variation takes a prepared mesh and returns another mesh of the same shape as it might be
uploaded, which has to be prepared in turn. Training learns from such copies (`vary`);
`benchmarks.robustness` measures each kind on test meshes.
"""

import igl
import numpy as np
import trimesh
from numpy.typing import NDArray

from meshconv3d.model.mesh import Mesh
from meshconv3d.model.preparation.simplification import simplify
from meshconv3d.model.topology import Surface
from meshconv3d.model.topology.halfedges import edge_lengths, find_twins


def retriangulated(mesh: Mesh, rng: np.random.Generator) -> Mesh:
    """Four times the faces on the same surface, with a slight jitter along and across it."""
    finer = subdivided(mesh)
    noise = rng.normal(0, 0.05 * mean_edge(finer), finer.vertices.shape)
    return finer.moved(finer.vertices + noise)


def subdivided(mesh: Mesh) -> Mesh:
    """Every face cut into four, on the same surface."""
    return Mesh(*trimesh.remesh.subdivide(mesh.vertices, mesh.faces)[:2])


def smoothed(mesh: Mesh, times: int) -> Mesh:
    """Loop subdivision: 4^times as many faces, and rounder edges."""
    return Mesh(*igl.loop(np.asfortranarray(mesh.vertices), np.asfortranarray(mesh.faces), times))


def with_faces(mesh: Mesh, count: int) -> Mesh:
    """About `count` faces: subdivided until there are more, then simplified.

    mesh: an oriented manifold, as every prepared mesh is.
    """
    while len(mesh.faces) < count:
        mesh = subdivided(mesh)
    twin, _, _ = find_twins(mesh.faces, len(mesh.vertices))
    vertices, faces, _ = simplify(mesh.vertices, mesh.faces, twin, count)
    return Mesh(vertices, faces)


def noisy(mesh: Mesh, share: float, rng: np.random.Generator) -> Mesh:
    """Normal noise on every vertex; its deviation is a share of the bounding box's diagonal."""
    return mesh.moved(mesh.vertices + rng.normal(0, share * diagonal(mesh), mesh.vertices.shape))


def cut(mesh: Mesh, share: float, rng: np.random.Generator) -> Mesh:
    """A hole: a share of the faces, connected, around a random one."""
    patches = Surface.of(mesh).patches(max(round(share * len(mesh.faces)), 1))
    hole = patches[rng.integers(len(patches))]
    keep = np.ones(len(mesh.faces) + 1, bool)
    keep[hole] = False
    return Mesh(mesh.vertices, mesh.faces[keep[1:]])


def flipped(mesh: Mesh, share: float, rng: np.random.Generator | None = None) -> Mesh:
    """Other diagonals: a share of the edges flipped, at most one of each face.

    The flattest ones, or with `rng` random ones; none that bends by 60 degrees or more, before or
    after.
    """
    twin = Surface.of(mesh).twin
    h = np.flatnonzero(twin > np.arange(len(twin)))
    pairs = np.stack((h, twin[h])) // 3
    corners = np.stack((h, h + 1, h + 2, twin[h] + 2)) % 3
    a, b, c, d = mesh.faces[pairs[[0, 0, 0, 1]], corners]
    new = np.stack((np.stack((a, d, c), 1), np.stack((d, b, c), 1)))
    before, after = (_cosines(mesh, each) for each in (mesh.faces[pairs], new))
    order = np.argsort(-before, kind="stable") if rng is None else rng.permutation(len(h))
    sides = np.concatenate([mesh.faces[:, [s, (s + 1) % 3]] for s in range(3)])
    edges = {*map(frozenset, sides.tolist())}
    faces, taken = mesh.faces.copy(), np.zeros(len(mesh.faces), bool)
    left = round(share * len(h))
    for i in order[np.minimum(before, after)[order] > 0.5].tolist():
        diagonal = frozenset((int(c[i]), int(d[i])))
        if left == 0:
            break
        if diagonal not in edges and not taken[pairs[:, i]].any():
            edges.add(diagonal)
            faces[pairs[:, i]] = new[:, i]
            taken[pairs[:, i]] = True
            left -= 1
    return Mesh(mesh.vertices, faces)


def _cosines(mesh: Mesh, pairs: NDArray[np.int32]) -> NDArray[np.float64]:
    """Cosine of the angle between the two faces of each pair, N; -1 for slivers.

    pairs: 2 x N x 3, the corners of the two faces.
    """
    a, b, c = (mesh.vertices[pairs[:, :, s]] for s in range(3))
    normals = np.cross(b - a, c - a)
    lengths = np.linalg.norm(normals, axis=2)
    products = np.sum(normals[0] * normals[1], axis=1)
    return np.where(lengths.min(axis=0) > 0, products / np.maximum(lengths.prod(0), 1e-300), -1)


def mirrored(mesh: Mesh) -> Mesh:
    """The mirror image, with its faces turned so that they still look outwards."""
    return Mesh(mesh.vertices * (-1, 1, 1), mesh.faces[:, ::-1])


def diagonal(mesh: Mesh) -> float:
    """Length of the bounding box's diagonal."""
    return float(np.linalg.norm(np.ptp(mesh.vertices, axis=0)))


def mean_edge(mesh: Mesh) -> float:
    """Mean length of the half-edges."""
    return float(edge_lengths(mesh.vertices, mesh.faces).mean())


def vary(mesh: Mesh, rng: np.random.Generator) -> Mesh:
    """A random copy for training: other triangles, then perhaps others still, noise, a hole; half
    of them are mirror images."""
    if rng.random() < 0.5:
        mesh = mirrored(mesh)
    match rng.integers(6):
        case 0:
            mesh = retriangulated(mesh, rng)
        case 1:
            mesh = smoothed(mesh, 1)
        case 2:
            mesh = smoothed(mesh, 2)
        case 3 | 4:
            mesh = with_faces(mesh, int(np.exp(rng.uniform(np.log(200), np.log(2000)))))
        case _:
            pass
    if rng.random() < 0.3:
        mesh = flipped(mesh, rng.uniform(0, 0.3), rng)
    if rng.random() < 0.5:
        # On fine triangles, noise of the mesh's scale would be all that is left.
        most = min(0.01, 0.25 * mean_edge(mesh) / diagonal(mesh))
        mesh = noisy(mesh, rng.uniform(0, most), rng)
    if rng.random() < 0.3:
        mesh = cut(mesh, rng.uniform(0.02, 0.12), rng)
    return mesh
