"""The network's forward pass as the paper's equations, in plain torch, for comparison.

Every patch is a stacked tensor, N x (K - 1) x C, as a first implementation has it, of which
automatic differentiation keeps what it needs. The weights are those of a `Network`, so that values
and gradients can be compared. For geometric pooling with means over patches and faces.
"""

from collections.abc import Mapping

import torch
from torch import Tensor

from meshconv3d.model.nn.layers import PatchConvolution
from meshconv3d.model.nn.network import Network


def scores(network: Network, arrays: Mapping[str, Tensor]) -> Tensor:
    """The scores of a batch, B x N_c; arrays: those of `collate`, as tensors."""
    sizes = [describe[0].in_features for describe in network.descriptors]
    parts = arrays["terms"].split(sizes, dim=1)
    described = [describe(part) for describe, part in zip(network.descriptors, parts, strict=True)]
    features = torch.cat(described, dim=1)  # equation 3
    for level, block in enumerate(network.blocks):
        for convolution in block:  # type: ignore[attr-defined]
            features = _convolve(convolution, features, arrays[f"patches_{level}"])
        features = _mean(features, arrays[f"pools_{level}"])
    return network.classify(_mean(features, arrays["readout"]))


def _convolve(layer: PatchConvolution, features: Tensor, patches: Tensor) -> Tensor:
    """Equation 4: N x C_in -> N x C_out."""
    near = _stack(features, patches[:, 1:])  # N x (K - 1) x C_in
    there = _there(patches[:, 1:], features)  # N x (K - 1) x 1
    present = there.sum(dim=1).clamp(min=1)
    total = near.sum(dim=1) / present
    differences = ((near - features[:, None]).abs() * there).sum(dim=1) / present
    return torch.relu(layer.norm(layer.linear(torch.cat([features, total, differences], dim=1))))


def _mean(features: Tensor, index: Tensor) -> Tensor:
    """Mean over the faces that each row of an index names: M x C."""
    present = _there(index, features).sum(dim=1).clamp(min=1)
    return _stack(features, index).sum(dim=1) / present


def _stack(features: Tensor, index: Tensor) -> Tensor:
    """The faces that each row of an index names, M x W x C; the null face is zeros."""
    table = torch.cat([features.new_zeros(1, features.shape[1]), features])
    return table[index.long()]


def _there(index: Tensor, features: Tensor) -> Tensor:
    return (index > 0).to(features.dtype)[:, :, None]
