"""Every pooling level has the topology of its surface, and renumbering changes none."""

from collections import Counter, defaultdict
from collections.abc import Collection, Iterable
from typing import NamedTuple

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from meshconv3d.model.loading import load_mesh
from meshconv3d.model.mesh import Mesh
from meshconv3d.model.preparation import prepare
from meshconv3d.model.topology import build_topology
from meshconv3d.model.topology.descriptors import pooling_features
from meshconv3d.model.topology.geometry import face_geometry
from meshconv3d.model.topology.halfedges import find_twins
from meshconv3d.model.topology.pooling import gather_mean
from meshconv3d.model.topology.surface import Surface
from tests.meshes import torus
from tests.surfaces import MANIFOLD, closed_surface, sides_of, triangles

SEEDS = st.integers(0, 2**32 - 1)


class Invariants(NamedTuple):
    """What pooling keeps of a surface."""

    euler_characteristic: int
    components: int
    borders: int
    closed: bool


def invariants(surface: Surface) -> Invariants:
    """Those of a surface, which must be sound: a manifold, whose twins are those of its edges."""
    faces = surface.faces.tolist()
    # No face is degenerate or there twice, so that no two share two sides.
    assert all(len({*face}) == 3 for face in faces)
    assert len({frozenset(face) for face in faces}) == len(faces)
    edges = Counter(frozenset(edge) for face in faces for edge in sides_of(face))
    assert max(edges.values()) <= 2
    twin, _, _ = find_twins(surface.faces, int(surface.faces.max()) + 1)
    assert (surface.twin == twin).all()
    # The sides of the faces around a vertex that do not meet it make one line, open or closed.
    links = defaultdict(list)
    for a, b, c in faces:
        for v, side in ((a, (b, c)), (b, (c, a)), (c, (a, b))):
            links[v].append(side)
    for sides in links.values():
        ends = Counter(v for side in sides for v in side)
        assert max(ends.values()) <= 2
        assert connected(sides) == 1
    border = [edge for edge, count in edges.items() if count == 1]
    components, borders = connected(edges), connected(border)
    return Invariants(len(links) - len(edges) + len(faces), components, borders, not border)


def connected(edges: Iterable[Collection[int]]) -> int:
    """Components of the graph whose edges, or cliques, are given."""
    root: dict[int, int] = {}

    def find(v: int) -> int:
        while root.setdefault(v, v) != v:
            v = root[v]
        return v

    for first, *others in edges:
        for v in others:
            root[find(v)] = find(first)
    return len({find(v) for v in [*root]})


def check_level(before: Surface, after: Surface, index, shares, target: int) -> None:
    faces = before.face_count
    # Every pooled face gathers itself first, and living faces.
    assert index.shape[0] == after.face_count >= 1
    assert (index[:, 0] > 0).all()
    assert (np.diff(index[:, 0]) > 0).all()
    assert (index >= 0).all()
    assert (index <= faces).all()
    assert shares.sum(axis=1) == pytest.approx(1)
    assert ((shares > 0) == (index > 0)).all()
    # Never far below the target, and nothing at all is done to what fits.
    assert after.face_count >= min(faces, target - 3)
    if faces <= target:
        assert (index == np.arange(1, faces + 1)[:, None]).all()
        assert (after.faces == before.faces).all()
    assert after.lengths.tolist() == before.lengths.reshape(-1, 3)[index[:, 0] - 1].ravel().tolist()
    assert invariants(after) == invariants(before)


def pool_levels(surface: Surface, features: np.ndarray, targets: list[int]) -> list[int]:
    """Pool level by level, checking each; the face counts."""
    counts = [surface.face_count]
    for target in targets:
        pooled, index, shares = surface.pool(features, target)
        check_level(surface, pooled, index, shares, target)
        surface, features = pooled, gather_mean(features, index)
        counts.append(surface.face_count)
    return counts


@given(triangles(kinds=MANIFOLD), st.lists(st.integers(1, 90), min_size=1, max_size=4), SEEDS)
@settings(max_examples=200)
def test_every_level_is_the_same_surface_in_fewer_faces(surface, targets, seed):
    features = np.random.default_rng(seed).random((len(surface.faces), 3))
    pool_levels(Surface.of(surface.mesh()), features, targets)


@given(triangles(kinds=("non-manifold",)), st.integers(1, 40), SEEDS)
def test_a_surface_that_is_no_manifold_does_no_harm(surface, target, seed):
    count = len(surface.faces)
    features = np.random.default_rng(seed).random((count, 2))
    pooled, _, _ = Surface.of(surface.mesh()).pool(features, target)
    assert pooled.face_count >= min(count, target - 3)
    paired = np.flatnonzero(pooled.twin >= 0)
    assert (pooled.twin[pooled.twin[paired]] == paired).all()


@pytest.mark.parametrize("flips", [0, 1, 5])
@pytest.mark.parametrize("handles", [0, 1, 2])
def test_every_closed_surface_of_500_faces_reaches_400_300_and_200(handles, flips):
    rng = np.random.default_rng([handles, int(flips)])
    for _ in range(3):
        faces = closed_surface(rng, handles, 500, flips)
        assert len(faces) == 500
        mesh = Mesh(rng.normal(size=(faces.max() + 1, 3)), faces)
        counts = pool_levels(Surface.of(mesh), rng.random((500, 3)), [400, 300, 200])
        assert counts == [500, 400, 300, 200]


@pytest.mark.parametrize("target", [50, 100])
def test_low_targets_are_reached_in_one_level(target):
    features = np.random.default_rng(target).random((500, 3))
    _, count = pool_levels(Surface.of(torus()), features, [target])
    assert target - 3 <= count <= target


def test_all_of_shrec11_reaches_its_targets_and_keeps_its_topology(shrec):
    paths = sorted(shrec.glob("*/*/*.obj"))
    assert len(paths) == 600
    for path in paths:
        mesh, _ = prepare(load_mesh(path), 500)
        surface = Surface.of(mesh)
        features = pooling_features(face_geometry(mesh.vertices, mesh.faces))
        characteristic = euler_characteristic(surface)
        for target in (400, 300, 200):
            surface, index, _ = surface.pool(features, target)
            features = gather_mean(features, index)
            assert surface.face_count == target
        # Closed and in one part, as all of them are.
        assert (surface.twin >= 0).all()
        assert connected(surface.faces.tolist()) == 1
        assert euler_characteristic(surface) == characteristic


def euler_characteristic(surface: Surface) -> int:
    """Of a closed surface."""
    return len(np.unique(surface.faces)) - len(surface.twin) // 2 + surface.face_count


def test_pooling_is_deterministic():
    features = np.random.default_rng(5).random((500, 6))
    one, two = (build_topology(Surface.of(torus()), features, 10, (400, 300, 200)) for _ in "ab")
    for a, b in zip(one.patches + one.pools, two.patches + two.pools, strict=True):
        assert (a == b).all()


def by_name(topology, names) -> list[dict]:
    """Each level as {face: patch} and {survivor: faces it gathers}, faces by their names."""
    levels = []
    for patches, pool in zip(topology.patches, topology.pools, strict=True):
        table = np.array([-1, *names])
        levels.append({table[row[0]]: table[row].tolist() for row in patches})
        levels.append({table[row[0]]: {*table[row[row > 0]].tolist()} for row in pool})
        names = table[pool[:, 0]]
    return levels


@given(triangles(), st.integers(1, 12), st.lists(st.integers(1, 90), min_size=1, max_size=4), SEEDS)
def test_levels_follow_on_from_each_other(surface, size, targets, seed):
    start = Surface.of(surface.mesh())
    features = np.random.default_rng(seed).random((start.face_count, 2))
    topology = build_topology(start, features, size, targets)
    counts = topology.face_counts
    assert len(topology.patches) == len(topology.pools) == len(targets)
    assert counts[0] == len(surface.faces)
    for level, target in enumerate(targets):
        pooled, index, _ = start.pool(features, target)
        assert (topology.patches[level] == start.patches(size)).all()
        assert (topology.pools[level] == index).all()
        assert topology.patches[level].shape == (counts[level], size)
        assert counts[level + 1] == len(index) == pooled.face_count
        start, features = pooled, gather_mean(features, index)


@given(triangles(kinds=MANIFOLD), SEEDS)
def test_renumbering_vertices_faces_and_corners_renames_and_changes_nothing(surface, seed):
    rng = np.random.default_rng(seed)
    mesh = surface.mesh()
    count = len(mesh.faces)
    order, turns = rng.permutation(count), rng.integers(0, 3, (count, 1))
    vertex_order = rng.permutation(len(mesh.vertices))
    faces = np.take_along_axis(mesh.faces, (np.arange(3) + turns) % 3, axis=1)
    other = Mesh(mesh.vertices[vertex_order], np.argsort(vertex_order)[faces][order])
    features = rng.random((count, 4))
    targets = [count * 3 // 4 + 1, count // 2 + 1]
    one = build_topology(Surface.of(mesh), features, 7, targets)
    two = build_topology(Surface.of(other), features[order], 7, targets)
    assert by_name(one, np.arange(count)) == by_name(two, order)


def test_a_mirrored_mesh_has_the_same_topology():
    mesh, features = torus(), np.random.default_rng(1).random((500, 4))
    mirrored = Mesh(mesh.vertices * [1, 1, -1], mesh.faces[:, ::-1])
    one = build_topology(Surface.of(mesh), features, 10, (400, 300, 200))
    two = build_topology(Surface.of(mirrored), features, 10, (400, 300, 200))
    assert by_name(one, np.arange(500)) == by_name(two, np.arange(500))


def test_the_mean_takes_the_named_rows_and_no_null_row():
    features = np.array([[1.0, 10.0], [3.0, 30.0], [8.0, 80.0]])
    index = np.array([[2, 0, 0], [1, 2, 0], [3, 1, 2], [1, 1, 3]], np.int32)
    expected = np.array([[3, 30], [2, 20], [4, 40], [10 / 3, 100 / 3]])
    assert gather_mean(features, index) == pytest.approx(expected)
