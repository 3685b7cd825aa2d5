"""Pooling as a graph gives the faces, twins and indices of the kernel."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from meshconv3d.export.whole.arrays import INT, REAL
from meshconv3d.export.whole.pooling import gather_mean, pool_faces
from meshconv3d.model.topology import pooling as kernels
from meshconv3d.model.topology.halfedges import find_twins
from tests.export.whole.graphs import Written
from tests.meshes import icosphere, sheet, torus
from tests.surfaces import MANIFOLD, Triangles, triangles

SEEDS = st.integers(0, 2**32 - 1)


def pooling(target: int, squared: bool, literal: bool) -> Written:
    return Written(
        lambda faces, twin, features, count: pool_faces(
            faces, twin, features, count, target, squared, literal
        ),
        INT,
        INT,
        REAL,
        INT,
    )


GRAPHS = {
    options: pooling(*options)
    for options in [(1, True, False), (8, True, False), (40, False, False), (8, False, True)]
}


def assert_same(options: tuple[int, bool, bool], faces: np.ndarray, features: np.ndarray) -> None:
    count = int(faces.max()) + 1
    twin, _, _ = find_twins(faces, count)
    expected = kernels.pool_faces(faces, twin, features, *options)
    found = GRAPHS[options](faces, twin, features, count)
    for name, ours in zip(kernels.PooledFaces._fields, found, strict=True):
        np.testing.assert_array_equal(ours, getattr(expected, name), err_msg=name)


@pytest.mark.parametrize("options", GRAPHS)
@given(triangles(kinds=MANIFOLD, most=100), SEEDS)
@settings(max_examples=40)
def test_random_features(options: tuple[int, bool, bool], surface: Triangles, seed: int) -> None:
    features = np.random.default_rng(seed).normal(size=(len(surface.faces), 6))
    assert_same(options, surface.faces, features.astype(np.float32))


@given(triangles(kinds=MANIFOLD, most=100), SEEDS)
@settings(max_examples=40)
def test_ties_go_to_the_first_face(surface: Triangles, seed: int) -> None:
    """Features of few values, so that most weights have an equal."""
    features = np.random.default_rng(seed).integers(0, 2, (len(surface.faces), 2))
    assert_same((8, True, False), surface.faces, features.astype(np.float32))


@pytest.mark.parametrize("mesh", [torus(), sheet(), icosphere(3)], ids=["torus", "sheet", "sphere"])
def test_smooth_features_need_many_rounds(mesh) -> None:
    """Where each face waits for the one before it."""
    features = np.arange(len(mesh.faces), dtype=np.float32)[:, None] ** 2
    assert_same((8, True, False), mesh.faces, features)


@given(triangles(kinds=MANIFOLD, most=60), SEEDS)
@settings(max_examples=30)
def test_means_of_gathered_features_are_equal_to_the_last_bit(
    surface: Triangles, seed: int
) -> None:
    """The faces of the next level are chosen by them."""
    features = np.random.default_rng(seed).normal(size=(len(surface.faces), 6)).astype(np.float32)
    twin, _, _ = find_twins(surface.faces, surface.vertex_count)
    index = kernels.pool_faces(surface.faces, twin, features, 1, True, False).index
    (found,) = MEANS(features, index)
    np.testing.assert_array_equal(found, kernels.gather_mean(features, index))


MEANS = Written(lambda features, index: [gather_mean(features, index)], REAL, INT)
