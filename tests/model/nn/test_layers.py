"""The learned layers against loops over faces."""

import numpy as np
import pytest
import torch
from hypothesis import given
from hypothesis import strategies as st

from meshconv3d.model.nn.layers import (
    PatchConvolution,
    gather_mean,
    gather_rows,
    patch_statistics,
    weight_peaks,
)
from meshconv3d.model.topology import Surface
from tests.meshes import cube
from tests.surfaces import triangles


def random_features(faces: int, channels: int = 5, seed: int = 0) -> torch.Tensor:
    return torch.from_numpy(np.random.default_rng(seed).normal(size=(faces, channels)))


def test_the_null_face_reads_zeros():
    features = random_features(4)
    rows = gather_rows(features, torch.tensor([[0, 1], [4, 0]]))
    assert (rows[0, 0] == 0).all()
    assert (rows[1, 1] == 0).all()
    assert (rows[0, 1] == features[0]).all()
    assert (rows[1, 0] == features[3]).all()


@given(st.integers(0, 2**32 - 1), st.integers(1, 6), st.integers(1, 9))
def test_means_ignore_nulls(seed, width, count):
    rng = np.random.default_rng(seed)
    features, index = random_features(8), torch.from_numpy(rng.integers(0, 9, (count, width)))
    means = gather_mean(features, index)
    for row, mean in zip(index.tolist(), means, strict=True):
        named = [features[f - 1] for f in row if f]
        expected = sum(named) / len(named) if named else torch.zeros(5)
        assert torch.allclose(mean, torch.as_tensor(expected).to(mean))
    # The operation of training gives the same values, and the gradient of a mean.
    trained = features.clone().requires_grad_()
    found = gather_mean(trained, index)
    assert torch.allclose(found, means)
    found.sum().backward()
    shares = torch.zeros(8)
    for row in index.tolist():
        for f in filter(None, row):
            shares[f - 1] += 1 / np.count_nonzero(row)
    assert trained.grad is not None
    assert torch.allclose(trained.grad, shares[:, None].to(trained.grad).expand(8, 5))


@given(triangles(most=30), st.integers(1, 14))
def test_patch_statistics_are_means_over_the_faces_that_are_there(surface, size):
    patches = Surface.of(surface.mesh()).patches(size)
    features = random_features(len(patches))
    statistics = patch_statistics(features, torch.from_numpy(patches[:, 1:]))
    for f, patch in enumerate(patches.tolist()):
        centre = features[f]
        near = [features[n - 1] for n in patch[1:] if n]
        none = torch.zeros_like(centre)
        mean = torch.stack(near).mean(dim=0) if near else none
        difference = torch.stack([(n - centre).abs() for n in near]).mean(dim=0) if near else none
        assert torch.allclose(statistics[f], torch.cat([centre, mean, difference]), atol=1e-12)


@pytest.mark.parametrize("size", [12, 13, 40])
def test_a_patch_larger_than_its_component_is_the_component(size):
    surface, features = Surface.of(cube()), random_features(12).float()
    layer = PatchConvolution(5, 7).eval()
    whole = layer(features, torch.from_numpy(surface.patches(12)))
    padded = layer(features, torch.from_numpy(surface.patches(size)))
    assert torch.allclose(whole, padded, atol=1e-6)


def test_a_patch_of_one_sees_only_its_face():
    features = random_features(12).float()
    layer = PatchConvolution(5, 7).eval()
    patches = torch.from_numpy(Surface.of(cube()).patches(1))
    with torch.no_grad():
        one = layer(features, patches)
        alone = torch.cat([layer(features[f : f + 1], torch.tensor([[1]])) for f in range(12)])
        expected = torch.relu(layer.norm(features @ layer.linear.weight[:, :5].T))
    assert torch.allclose(one, alone, atol=1e-6)
    assert torch.allclose(one, expected, atol=1e-6)


def test_the_order_of_a_patch_does_not_matter_but_its_centre_does():
    surface, features = Surface.of(cube()), random_features(12).float()
    layer = PatchConvolution(5, 7).eval()
    patches = torch.from_numpy(surface.patches(8))
    turned = torch.cat([patches[:, :1], patches[:, 1:].flip(1)], dim=1)
    assert torch.allclose(layer(features, patches), layer(features, turned), atol=1e-6)
    assert not torch.allclose(layer(features, patches), layer(features.roll(1, 0), patches))


@given(st.integers(0, 2**32 - 1))
def test_peaks_are_means_weighed_by_the_third_power_and_sum_up_by_face(seed):
    rng = np.random.default_rng(seed)
    counts = rng.integers(1, 7, 3)
    features = random_features(counts.sum(), seed=seed).clamp(min=0) * 3
    ends = np.cumsum(counts)
    meshes = [np.arange(end - count, end) + 1 for end, count in zip(ends, counts, strict=True)]
    index = torch.from_numpy(np.stack([np.pad(mesh, (0, 6 - len(mesh))) for mesh in meshes]))
    spread = weight_peaks(features, index)
    assert spread.shape == features.shape
    for mesh, peak in zip(meshes, gather_mean(spread, index), strict=True):
        own = features[mesh - 1]
        expected = (own**4).sum(dim=0) / ((own**3).sum(dim=0) + 1e-6 * len(mesh))
        assert torch.allclose(peak, expected)
        assert (peak <= own.amax(dim=0) + 1e-9).all()
        assert (peak >= own.mean(dim=0) - 1e-2).all()


def test_peaks_of_faces_that_are_alike_are_shared():
    features = torch.tensor([[2.0, 0.0], [2.0, 0.0], [0.0, 0.0]])
    spread = weight_peaks(features, torch.tensor([[1, 2, 3]]))
    assert torch.allclose(spread, torch.tensor([[3.0, 0.0], [3.0, 0.0], [0.0, 0.0]]))
