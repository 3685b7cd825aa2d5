"""Augmented copies: moved vertices over the same topology."""

from dataclasses import replace

import numpy as np
import pytest

from model.alignment import FLIPS
from model.augmentation import Augmentation
from model.config import NetworkConfig
from model.datasets import LabelledMesh
from model.inputs import mesh_inputs
from model.mesh import Mesh
from model.preparation import prepare
from tests.meshes import sheet, torus

STILL = Augmentation(scale=0, jitter=0, wobble=0, flip=0)


@pytest.fixture
def own(config: NetworkConfig) -> NetworkConfig:
    """The network in the meshes' own axes."""
    return replace(config, axes="principal")


def lopsided() -> Mesh:
    mesh = torus()
    return mesh.moved(mesh.vertices * np.exp(0.4 * mesh.vertices) * [1, 0.7, 0.5])


def labelled(mesh: Mesh, config: NetworkConfig) -> LabelledMesh:
    prepared, _ = prepare(mesh, config.face_budget)
    return LabelledMesh(prepared, mesh_inputs(prepared, config), 0)


@pytest.mark.parametrize("mesh", [lopsided(), sheet()], ids=["closed", "open"])
@pytest.mark.parametrize("absolute_offsets", [False, True])
def test_copies_keep_their_topology(config, mesh, absolute_offsets):
    config = replace(config, absolute_offsets=absolute_offsets)
    sample = labelled(mesh, config)
    copy = Augmentation().apply(sample, config, np.random.default_rng(4))
    assert copy.topology is sample.inputs.topology
    assert copy.surface is sample.inputs.surface
    assert copy.terms.shape == sample.inputs.terms.shape
    assert copy.terms.dtype == np.float32


def test_however_it_is_turned_a_mesh_has_its_own_axes(own):
    sample = labelled(lopsided(), own)
    copy = STILL.apply(sample, own, np.random.default_rng(0))
    assert copy.terms == pytest.approx(sample.inputs.terms, abs=1e-6)


def test_a_rotated_copy_keeps_every_distance(config):
    sample = labelled(lopsided(), config)
    copy = STILL.apply(sample, config, np.random.default_rng(0))
    centroids, before = copy.terms[:, 3], sample.inputs.terms[:, 3]
    assert centroids @ centroids.T == pytest.approx(before @ before.T, abs=1e-5)
    assert np.abs(centroids - before).max() > 0.1


def test_a_flip_is_a_half_turn_about_an_axis(own):
    sample = labelled(lopsided(), own)
    copy = replace(STILL, flip=1).apply(sample, own, np.random.default_rng(0))
    turned = [sample.inputs.terms[:, 3] * flip for flip in FLIPS[1:]]
    assert any(copy.terms[:, 3] == pytest.approx(each, abs=1e-6) for each in turned)


@pytest.mark.parametrize(
    "change", [{"scale": 0.2}, {"jitter": 0.01}, {"wobble": 0.1}], ids=lambda c: next(iter(c))
)
def test_each_movement_moves_and_its_generator_decides_how(own, change):
    sample = labelled(lopsided(), own)
    augmentation = replace(STILL, **change)
    one, same, other = (
        augmentation.apply(sample, own, np.random.default_rng(seed)).terms for seed in (1, 1, 2)
    )
    assert (one == same).all()
    assert np.abs(one - other).max() > 1e-3
    assert np.abs(one - sample.inputs.terms).max() > 1e-3
