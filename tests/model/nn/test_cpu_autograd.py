"""The compiled convolution against torch's operations: same values, same gradients."""

import numpy as np
import pytest
import torch

from meshconv3d.model.nn.cpu_autograd import PatchLinear
from meshconv3d.model.nn.layers import patch_statistics, uses_cpu_autograd

ROWS, CHANNELS = 12, 5


def table(seed: int, dtype: torch.dtype = torch.float64) -> torch.Tensor:
    generator = torch.Generator().manual_seed(seed)
    return torch.randn(ROWS, CHANNELS, generator=generator, dtype=dtype)


def index(width: int, seed: int = 0) -> torch.Tensor:
    """Any faces, repeated ones and null faces included; one row has none at all."""
    values = np.random.default_rng(seed).integers(0, ROWS + 1, (ROWS, width), dtype=np.int32)
    values[3] = 0
    return torch.from_numpy(values)


def weight(dtype: torch.dtype = torch.float64) -> torch.Tensor:
    generator = torch.Generator().manual_seed(9)
    return torch.randn(4, 3 * CHANNELS, generator=generator, dtype=dtype)


def by_operations(features, neighbours, weight, summed):
    return patch_statistics(features, neighbours, summed) @ weight.T


# Faces to a block: all in one, some in the last, one in each.
@pytest.fixture(params=[1024, 5, 1])
def blocks(request, monkeypatch):
    monkeypatch.setattr("meshconv3d.model.nn.cpu_autograd.BLOCK", request.param)


@pytest.mark.usefixtures("blocks")
@pytest.mark.parametrize("width", [0, 1, 9])
@pytest.mark.parametrize("summed", [False, True])
@pytest.mark.parametrize("dtype", [torch.float32, torch.float64])
def test_patches_give_what_the_operations_give(width, summed, dtype):
    arguments = table(0, dtype), index(width), weight(dtype), summed
    found = PatchLinear.apply(*arguments)
    assert found.dtype == dtype
    assert torch.allclose(found, by_operations(*arguments), rtol=1e-5, atol=1e-5)


@pytest.mark.usefixtures("blocks")
@pytest.mark.parametrize("width", [0, 1, 9])
@pytest.mark.parametrize("summed", [False, True])
def test_the_gradients_of_patches_are_those_of_the_operations(width, summed):
    towards = torch.randn(ROWS, 4, dtype=torch.float64)
    gradients = []
    for product in (PatchLinear.apply, by_operations):
        features, matrix = table(1).requires_grad_(), weight().requires_grad_()
        (product(features, index(width), matrix, summed) * towards).sum().backward()
        gradients.append((features.grad, matrix.grad))
    for found, expected in zip(*gradients, strict=True):
        assert torch.allclose(found, expected, rtol=1e-9, atol=1e-12)


def test_equal_features_have_no_gradient_of_their_difference():
    features = torch.ones(3, 2, dtype=torch.float64, requires_grad=True)
    neighbours = torch.tensor([[2, 3], [1, 3], [1, 2]], dtype=torch.int32)
    differences = torch.eye(6, dtype=torch.float64)[4:]
    PatchLinear.apply(features, neighbours, differences, False).sum().backward()
    assert features.grad is not None
    assert features.grad.abs().sum() == 0


def test_only_what_is_trained_uses_cpu_autograd():
    assert uses_cpu_autograd(table(0).requires_grad_())
    with torch.inference_mode():
        assert not uses_cpu_autograd(table(0))
