"""Every pooling level of every surface is sound, and renumbering changes none."""

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
from meshconv3d.model.topology.pooling import SLACK, gather_mean
from meshconv3d.model.topology.surface import Surface
from tests.meshes import torus
from tests.surfaces import MANIFOLD, closed_surface, triangles

SEEDS = st.integers(0, 2**32 - 1)


def check_level(before: Surface, after: Surface, index: np.ndarray, target: int) -> None:
    faces = before.face_count
    # The twin relation is symmetric, and no face is its own neighbour.
    paired = np.flatnonzero(after.twin >= 0)
    assert (after.twin[after.twin[paired]] == paired).all()
    beside = np.where(after.twin >= 0, after.twin // 3, -1).reshape(-1, 3)
    assert (beside != np.arange(after.face_count)[:, None]).all()
    # No two faces share two sides.
    for a, b in ((0, 1), (1, 2), (2, 0)):
        assert ((beside[:, a] != beside[:, b]) | (beside[:, a] < 0)).all()
    # Every pooled face gathers living faces, itself first and none twice.
    assert index.shape[0] == after.face_count >= 1
    assert (index[:, 0] > 0).all()
    assert (np.diff(index[:, 0]) > 0).all()
    assert (index >= 0).all()
    assert (index <= faces).all()
    for row in index.tolist():
        named = [f for f in row if f]
        assert len({*named}) == len(named)
    # Never far below the target, and nothing at all is done to what fits.
    assert after.face_count >= min(faces, target - SLACK)
    if faces <= target:
        assert (index == np.arange(1, faces + 1)[:, None]).all()
        assert (after.twin == before.twin).all()
    assert after.lengths.tolist() == before.lengths.reshape(-1, 3)[index[:, 0] - 1].ravel().tolist()


def pool_levels(surface: Surface, features: np.ndarray, targets: list[int]) -> list[int]:
    """Pool level by level, checking each; the face counts."""
    counts = [surface.face_count]
    for target in targets:
        pooled, index, _ = surface.pool(features, target)
        check_level(surface, pooled, index, target)
        surface, features = pooled, gather_mean(features, index)
        counts.append(surface.face_count)
    return counts


@given(triangles(), st.lists(st.integers(1, 90), min_size=1, max_size=4), SEEDS)
@settings(max_examples=300)
def test_every_level_of_any_surface_is_sound(surface, targets, seed):
    features = np.random.default_rng(seed).random((len(surface.faces), 3))
    pool_levels(Surface.of(surface.mesh()), features, targets)


@given(triangles(), st.integers(1, 20), SEEDS)
def test_where_all_faces_are_alike_the_levels_are_sound_too(surface, target, seed):
    features = np.random.default_rng(seed).integers(0, 2, (len(surface.faces), 1)).astype(float)
    pool_levels(Surface.of(surface.mesh()), features, [target])


@given(triangles(kinds=("components",)), SEEDS)
def test_no_component_disappears(surface, seed):
    start = Surface.of(surface.mesh())
    features = np.random.default_rng(seed).random((start.face_count, 2))
    _, index, _ = start.pool(features, 1)
    survivors = {*(index[:, 0] - 1).tolist()}
    for patch in start.patches(start.face_count):
        assert survivors & {f - 1 for f in patch.tolist() if f}


@pytest.mark.parametrize("flips", [0, 1, 5])
@pytest.mark.parametrize("handles", [0, 1, 2, 10, 30])
def test_every_closed_surface_of_500_faces_reaches_400_300_and_200(handles, flips):
    rng = np.random.default_rng([handles, int(flips)])
    for _ in range(5):
        faces = closed_surface(rng, handles, 500, flips)
        assert len(faces) == 500
        mesh = Mesh(rng.normal(size=(faces.max() + 1, 3)), faces)
        counts = pool_levels(Surface.of(mesh), rng.random((500, 3)), [400, 300, 200])
        assert all(
            target - SLACK <= count <= target
            for count, target in zip(counts[1:], (400, 300, 200), strict=True)
        )


@pytest.mark.parametrize("target", [20, 50, 100])
def test_low_targets_are_reached_in_one_level(target):
    features = np.random.default_rng(target).random((500, 3))
    _, count = pool_levels(Surface.of(torus()), features, [target])
    assert target - SLACK <= count <= target


def test_all_of_shrec11_reaches_its_targets_and_every_level_is_sound(shrec):
    counts = []
    for path in sorted(shrec.glob("*/*/*.obj")):
        mesh, _ = prepare(load_mesh(path), 500)
        surface = Surface.of(mesh)
        features = pooling_features(face_geometry(mesh.vertices, mesh.faces))
        counts.append(pool_levels(surface, features, [400, 300, 200])[1:])
    below = np.array([400, 300, 200]) - counts
    assert len(counts) == 600
    assert (below >= 0).all()
    assert (below <= 3).all(axis=1).mean() >= 0.95


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
    index = np.array([[2, 0, 0], [1, 2, 0], [3, 1, 2]], np.int32)
    expected = np.array([[3, 30], [2, 20], [4, 40]])
    assert gather_mean(features, index) == pytest.approx(expected)
