"""Learned pooling asks the features that enter it, and lets their gradient through."""

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
import torch

from meshconv3d.model.config import NetworkConfig
from meshconv3d.model.nn.levels import GeometricLevel, LearnedLevel, first_level
from meshconv3d.model.nn.network import Network, as_tensors
from meshconv3d.model.topology import Surface
from meshconv3d.model.topology.batch import join_indices
from meshconv3d.model.topology.inputs import collate, mesh_inputs
from meshconv3d.model.topology.pooling import gather_mean
from tests.meshes import icosphere, sheet, torus

MESHES = [torus(), sheet(), icosphere(3)]
LEARNED = NetworkConfig(
    classes=("a", "b", "c"),
    channels=(8, 12, 16),
    descriptor_hidden=8,
    descriptor_channels=6,
    pooling="learned",
)


def tensors(config: NetworkConfig) -> tuple[torch.Tensor, ...]:
    return as_tensors(collate([mesh_inputs(mesh, config) for mesh in MESHES]))


def test_the_configuration_chooses_the_level() -> None:
    _, *topology = tensors(LEARNED)
    assert isinstance(first_level(LEARNED, topology), LearnedLevel)
    geometric = NetworkConfig(classes=("a",))
    _, *topology = tensors(geometric)
    assert isinstance(first_level(geometric, topology), GeometricLevel)


def test_every_level_pools_by_the_features_it_is_given() -> None:
    surfaces = [Surface.of(mesh) for mesh in MESHES]
    level = first_level(LEARNED, tensors(LEARNED)[1:])
    rng = np.random.default_rng(0)
    for target in LEARNED.targets:
        starts = np.cumsum([0, *(surface.face_count for surface in surfaces)])
        patches = [surface.patches(LEARNED.patch_size) for surface in surfaces]
        assert (level.patches().numpy() == join_indices(patches, starts[:-1])).all()
        rows = [range(start, end) for start, end in pairwise(starts)]
        named = [set(row[row > 0] - 1) for row in level.readout().numpy()]
        assert named == [set(row) for row in rows]
        features = rng.normal(size=(starts[-1], 4)).astype(np.float32)
        pooled = [s.pool(features[row], target) for s, row in zip(surfaces, rows, strict=True)]
        index = join_indices([i for _, i, _ in pooled], starts[:-1])
        expected = gather_mean(features, index)
        found, level = level.pool(torch.from_numpy(features))
        assert found.numpy() == pytest.approx(expected, abs=1e-6)
        surfaces = [surface for surface, _, _ in pooled]


def test_other_features_collapse_other_faces() -> None:
    level = first_level(LEARNED, tensors(LEARNED)[1:])
    torch.manual_seed(0)
    features = torch.randn(2, len(tensors(LEARNED)[0]), 4)
    one, other = (level.pool(table)[0] for table in features)
    assert one.shape != other.shape or (one != other).any()


@pytest.mark.parametrize("literal", [False, True])
def test_the_gradient_reaches_every_weight(literal: bool) -> None:
    torch.manual_seed(0)
    config = replace(LEARNED, literal_pooling=literal)
    network = Network(config).train()
    scores = network(*tensors(config)).scores
    torch.nn.functional.cross_entropy(scores, torch.tensor([0, 1, 2])).backward()
    for name, parameter in network.named_parameters():
        assert parameter.grad is not None, name
        assert parameter.grad.abs().sum() > 0, name


def test_the_loss_goes_down_under_training() -> None:
    torch.manual_seed(0)
    network = Network(LEARNED).train()
    optimiser = torch.optim.Adam(network.parameters(), 0.01)
    inputs, labels, losses = tensors(LEARNED), torch.tensor([0, 1, 2]), []
    for _ in range(15):
        loss = torch.nn.functional.cross_entropy(network(*inputs)[0], labels)
        optimiser.zero_grad()
        loss.backward()
        optimiser.step()
        losses.append(loss.item())
    assert losses[-1] < losses[0] / 4
