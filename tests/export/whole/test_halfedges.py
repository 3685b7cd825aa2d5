"""Twins, adjacency and patches as a graph are those of the kernels."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from meshconv3d.export.whole.arrays import DOUBLE, INT
from meshconv3d.export.whole.halfedges import find_twins, grow_patches, sort_adjacency
from meshconv3d.model.topology import halfedges as kernels
from tests.export.whole.graphs import Written
from tests.surfaces import MANIFOLD, Triangles, triangles

twins = Written(lambda faces, count: [find_twins(faces, count)], INT, INT)
adjacencies = Written(lambda twin, lengths: [sort_adjacency(twin, lengths)], INT, DOUBLE)
PATCHES = {
    size: Written(lambda adjacency, size=size: [grow_patches(adjacency, size)], INT)
    for size in (1, 2, 10, 24)
}


@given(triangles(kinds=MANIFOLD))
@settings(max_examples=50)
def test_twins(surface: Triangles) -> None:
    expected, _, _ = kernels.find_twins(surface.faces, surface.vertex_count)
    (found,) = twins(surface.faces, surface.vertex_count)
    np.testing.assert_array_equal(found, expected)


@given(triangles())
@settings(max_examples=50)
def test_three_half_edges_over_one_edge_have_no_twins(surface: Triangles) -> None:
    expected, _, _ = kernels.find_twins(surface.faces, surface.vertex_count, False)
    (found,) = twins(surface.faces, surface.vertex_count)
    np.testing.assert_array_equal(found, expected)


@given(triangles(kinds=MANIFOLD), st.booleans())
@settings(max_examples=50)
def test_adjacency(surface: Triangles, ties: bool) -> None:
    twin, _, _ = kernels.find_twins(surface.faces, surface.vertex_count)
    lengths = np.ones(len(twin)) if ties else np.random.default_rng(0).random(len(twin))
    (found,) = adjacencies(twin, lengths)
    np.testing.assert_array_equal(found, kernels.sort_adjacency(twin, lengths))


@pytest.mark.parametrize("patch_size", PATCHES)
@given(triangles())
@settings(max_examples=40)
def test_patches(patch_size: int, surface: Triangles) -> None:
    """Of every kind: two faces that share two edges are each other's neighbour twice."""
    twin, _, _ = kernels.find_twins(surface.faces, surface.vertex_count)
    adjacency = kernels.sort_adjacency(twin, np.random.default_rng(0).random(len(twin)))
    (found,) = PATCHES[patch_size](adjacency)
    np.testing.assert_array_equal(found, kernels.grow_patches(adjacency, patch_size))


def test_a_strip_from_whose_end_patches_grow_by_one_face_a_step() -> None:
    faces = np.array([(i, i + 1, i + 2) for i in range(40)])
    twin, _, _ = kernels.find_twins(faces.astype(np.int32), 42)
    adjacency = kernels.sort_adjacency(twin, np.ones(len(twin)))
    (found,) = PATCHES[24](adjacency)
    np.testing.assert_array_equal(found, kernels.grow_patches(adjacency, 24))
    assert (found > 0).all()
