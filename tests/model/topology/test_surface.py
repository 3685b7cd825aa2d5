"""All levels of one mesh: their shapes, and what renumbering leaves as it was."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from meshconv3d.model.mesh import Mesh
from meshconv3d.model.topology import build_topology
from meshconv3d.model.topology.pooling import gather_mean
from meshconv3d.model.topology.surface import Surface
from tests.meshes import torus
from tests.surfaces import MANIFOLD, triangles

SEEDS = st.integers(0, 2**32 - 1)


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
