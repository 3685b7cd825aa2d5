"""Augmented copies: moved vertices over the same topology."""

import numpy as np
import pytest

from model.augmentation import Augmentation
from model.config import NetworkConfig
from model.datasets import LabelledMesh
from model.descriptors import descriptor_terms
from model.inputs import mesh_inputs
from model.mesh import Mesh
from model.preparation import into_unit_sphere, prepare
from model.topology import Surface
from tests.meshes import sheet, torus

STILL = Augmentation(rotate=False, scale=0, jitter=0)


def labelled(mesh: Mesh, config: NetworkConfig) -> LabelledMesh:
    prepared, _ = prepare(mesh, config.face_budget)
    return LabelledMesh(prepared, mesh_inputs(prepared, config), 0)


@pytest.mark.parametrize("mesh", [torus(), sheet()])
@pytest.mark.parametrize("absolute_offsets", [False, True])
def test_terms_are_those_of_the_moved_mesh_over_the_same_topology(config, mesh, absolute_offsets):
    sample = labelled(mesh, config)
    still = Augmentation(rotate=False, scale=0.3, jitter=0)
    copy = still.apply(sample, absolute_offsets, np.random.default_rng(4))
    factors = np.random.default_rng(4).uniform(0.7, 1.3, 3)
    moved = into_unit_sphere(sample.mesh.vertices * factors, sample.mesh.faces)
    surface = Surface.of(sample.mesh.moved(moved))
    assert (surface.twin == sample.inputs.surface.twin).all()
    expected = descriptor_terms(moved, sample.mesh.faces, surface.twin, absolute_offsets)
    assert copy.terms == pytest.approx(expected, abs=1e-6)
    assert copy.topology is sample.inputs.topology


def test_without_any_movement_the_copy_is_the_mesh(config):
    sample = labelled(torus(), config)
    copy = STILL.apply(sample, False, np.random.default_rng(0))
    assert copy.terms == pytest.approx(sample.inputs.terms, abs=1e-6)


def test_a_rotated_copy_keeps_every_distance(config):
    sample = labelled(torus(), config)
    turn = Augmentation(rotate=True, scale=0, jitter=0)
    copy = turn.apply(sample, False, np.random.default_rng(0))
    centroids, before = copy.terms[:, 3], sample.inputs.terms[:, 3]
    assert np.linalg.norm(centroids, axis=1) == pytest.approx(
        np.linalg.norm(before, axis=1), abs=1e-5
    )
    assert np.abs(centroids - before).max() > 0.1


@pytest.mark.parametrize(
    "change", [{"rotate": True}, {"scale": 0.2}, {"jitter": 0.01}], ids=lambda c: next(iter(c))
)
def test_each_movement_moves_and_its_generator_decides_how(config, change):
    sample = labelled(torus(), config)
    augmentation = Augmentation(**({"rotate": False, "scale": 0, "jitter": 0} | change))
    one, same, other = (
        augmentation.apply(sample, False, np.random.default_rng(seed)).terms for seed in (1, 1, 2)
    )
    assert (one == same).all()
    assert np.abs(one - other).max() > 1e-3
    assert np.abs(one - sample.inputs.terms).max() > 1e-3
