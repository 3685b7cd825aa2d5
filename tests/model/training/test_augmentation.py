"""Augmented copies: moved vertices over the same topology."""

from dataclasses import replace

import numpy as np
import pytest

from meshconv3d.model.config import NetworkConfig
from meshconv3d.model.mesh import Mesh
from meshconv3d.model.preparation import prepare
from meshconv3d.model.topology.inputs import mesh_inputs
from meshconv3d.model.training.augmentation import Augmentation
from meshconv3d.model.training.meshes import LabelledMesh
from tests.meshes import sheet, torus

STILL = Augmentation(scale=0, jitter=0)


@pytest.fixture
def of_file(config: NetworkConfig) -> NetworkConfig:
    """The network in the axes of the file."""
    return replace(config, axes="file")


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


def test_without_any_movement_but_a_rotation_the_copy_is_the_mesh(either):
    sample = labelled(lopsided(), either)
    copy = STILL.apply(sample, either, np.random.default_rng(0))
    assert copy.terms == pytest.approx(sample.inputs.terms, abs=1e-4)


def test_a_rotated_copy_keeps_every_distance(of_file):
    sample = labelled(lopsided(), of_file)
    copy = STILL.apply(sample, of_file, np.random.default_rng(0))
    centroids, before = copy.terms[:, 9:12], sample.inputs.terms[:, 9:12]
    assert centroids @ centroids.T == pytest.approx(before @ before.T, abs=1e-5)
    assert np.abs(centroids - before).max() > 0.1


@pytest.mark.parametrize("change", [{"scale": 0.2}, {"jitter": 0.01}], ids=lambda c: next(iter(c)))
def test_each_movement_moves_and_its_generator_decides_how(config, change):
    sample = labelled(lopsided(), config)
    augmentation = replace(STILL, **change)
    one, same, other = (
        augmentation.apply(sample, config, np.random.default_rng(seed)).terms for seed in (1, 1, 2)
    )
    assert (one == same).all()
    assert np.abs(one - other).max() > 1e-3
    assert np.abs(one - sample.inputs.terms).max() > 1e-3


def test_a_bend_changes_the_distances_that_a_rotation_keeps(of_file):
    sample = labelled(lopsided(), of_file)

    def spread(bend: float) -> float:
        """How much the distances between successive centroids vary over twenty copies."""
        aug, seeds = replace(STILL, bend=bend), range(20)
        copies = [aug.apply(sample, of_file, np.random.default_rng(seed)) for seed in seeds]
        steps = [np.linalg.norm(np.diff(c.terms[:, 9:12], axis=0), axis=1) for c in copies]
        return float(np.mean(np.std(steps, axis=0) / np.mean(steps, axis=0)))

    assert spread(0) < 1e-4
    assert 0.02 < spread(0.1) < spread(0.3) < 0.6
