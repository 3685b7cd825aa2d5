"""The compiled gathers against torch's own operations: same values, same gradients."""

import numpy as np
import pytest
import torch

from model.fused import GatherMean, PatchStatistics
from model.layers import gather_mean, is_fused, patch_statistics

ROWS, CHANNELS = 12, 5


def table(seed: int, dtype: torch.dtype = torch.float64) -> torch.Tensor:
    generator = torch.Generator().manual_seed(seed)
    return torch.randn(ROWS, CHANNELS, generator=generator, dtype=dtype)


def index(width: int, seed: int = 0) -> torch.Tensor:
    """Any faces, repeated ones and null faces included; one row has none at all."""
    values = np.random.default_rng(seed).integers(0, ROWS + 1, (ROWS, width), dtype=np.int32)
    values[3] = 0
    return torch.from_numpy(values)


@pytest.mark.parametrize("width", [1, 3, 9])
@pytest.mark.parametrize("summed", [False, True])
@pytest.mark.parametrize("dtype", [torch.float32, torch.float64])
def test_patches_give_what_the_operations_give(width, summed, dtype):
    neighbours, features = index(width), table(0, dtype)
    assert not is_fused(features)
    expected = patch_statistics(features, neighbours, summed)
    found = PatchStatistics.apply(features, neighbours, summed)
    assert found.dtype == dtype
    assert torch.allclose(found, expected, rtol=1e-5, atol=1e-6)


@pytest.mark.parametrize("width", [1, 3, 9])
@pytest.mark.parametrize("summed", [False, True])
def test_the_gradient_of_patches_is_that_of_the_operations(width, summed):
    neighbours, weight = index(width), torch.randn(ROWS, 3 * CHANNELS, dtype=torch.float64)
    gradients = []
    for statistics in (PatchStatistics.apply, by_operations(patch_statistics)):
        features = table(1).requires_grad_()
        (statistics(features, neighbours, summed) * weight).sum().backward()
        gradients.append(features.grad)
    assert torch.allclose(*gradients, rtol=1e-9, atol=1e-12)


@pytest.mark.parametrize("width", [1, 4])
def test_means_and_their_gradient_are_those_of_the_operations(width):
    rows, weight = index(width)[:7], torch.randn(7, CHANNELS, dtype=torch.float64)
    assert torch.allclose(GatherMean.apply(table(2), rows), gather_mean(table(2), rows))
    gradients = []
    for mean in (GatherMean.apply, by_operations(gather_mean)):
        features = table(2).requires_grad_()
        (mean(features, rows) * weight).sum().backward()
        gradients.append(features.grad)
    assert torch.allclose(*gradients, rtol=1e-9, atol=1e-12)


def test_equal_features_have_no_gradient_of_their_difference():
    features = torch.ones(3, 2, dtype=torch.float64, requires_grad=True)
    neighbours = torch.tensor([[2, 3], [1, 3], [1, 2]], dtype=torch.int32)
    PatchStatistics.apply(features, neighbours, False)[:, 4:].sum().backward()
    assert features.grad is not None
    assert features.grad.abs().sum() == 0


def test_only_what_is_trained_is_fused():
    assert is_fused(table(0).requires_grad_())
    with torch.inference_mode():
        assert not is_fused(table(0))


def by_operations(function):
    """The layer's operations, with torch's own gradient."""

    def apply(*arguments):
        with pytest.MonkeyPatch.context() as patch:
            patch.setattr("model.layers.is_fused", lambda features: False)
            return function(*arguments)

    return apply
