"""The two gathers of the network with their gradients, for training on a CPU.

Written with torch's own operations, a patch is a tensor of N x K x C, of which each step of the
arithmetic makes another, to be kept for the gradient. These compiled loops never hold more than
one row of it. `model.layers` has the same arithmetic as operations, for the exported graph and
for other devices; both give the same values and gradients.
"""

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor
from torch.autograd.function import once_differentiable

from model.kernels import kernel


class PatchStatistics(torch.autograd.Function):
    """`model.layers.patch_statistics`: N x C, N x (K - 1) -> N x 3 C."""

    @staticmethod
    def forward(ctx, features: Tensor, neighbours: Tensor, summed: bool) -> Tensor:
        table, index = features.detach().contiguous(), neighbours.contiguous()
        ctx.save_for_backward(table, index)
        ctx.summed = summed
        return torch.from_numpy(_gather_patches(table.numpy(), index.numpy(), summed))

    @staticmethod
    @once_differentiable
    def backward(ctx, gradient: Tensor) -> tuple[Tensor, None, None]:
        table, index = (saved.numpy() for saved in ctx.saved_tensors)
        gradient = gradient.contiguous()
        spread = _spread_patches(table, index, gradient.numpy(), ctx.summed)
        return torch.from_numpy(spread), None, None


class GatherMean(torch.autograd.Function):
    """`model.layers.gather_mean`: N x C, M x W -> M x C."""

    @staticmethod
    def forward(ctx, features: Tensor, index: Tensor) -> Tensor:
        table, index = features.detach().contiguous(), index.contiguous()
        ctx.save_for_backward(index)
        ctx.rows = len(table)
        return torch.from_numpy(_gather_means(table.numpy(), index.numpy()))

    @staticmethod
    @once_differentiable
    def backward(ctx, gradient: Tensor) -> tuple[Tensor, None]:
        (index,) = ctx.saved_tensors
        spread = _spread_means(index.numpy(), gradient.contiguous().numpy(), ctx.rows)
        return torch.from_numpy(spread), None


@kernel
def _share(index: NDArray[np.int32]) -> float:
    """One over the faces that a row of an index names, at least one."""
    present = 0
    for entry in index:
        present += entry > 0
    return 1.0 / max(present, 1)


@kernel
def _gather_patches(table: NDArray, neighbours: NDArray[np.int32], summed: bool) -> NDArray:
    rows, channels = table.shape
    out = np.zeros((rows, 3 * channels), table.dtype)
    for f in range(rows):
        share = table.dtype.type(1.0 if summed else _share(neighbours[f]))
        own = table[f]
        out[f, :channels] = own
        total, difference = out[f, channels : 2 * channels], out[f, 2 * channels :]
        for entry in neighbours[f]:
            if entry > 0:
                other = table[entry - 1]
                for c in range(channels):
                    total[c] += other[c]
                    difference[c] += abs(other[c] - own[c])
        for c in range(channels):
            total[c] *= share
            difference[c] *= share
    return out


@kernel
def _spread_patches(
    table: NDArray, neighbours: NDArray[np.int32], gradient: NDArray, summed: bool
) -> NDArray:
    rows, channels = table.shape
    out = np.zeros((rows, channels), table.dtype)
    by_difference = np.empty(channels, table.dtype)
    by_total = np.empty(channels, table.dtype)
    for f in range(rows):
        share = table.dtype.type(1.0 if summed else _share(neighbours[f]))
        own, spread = table[f], out[f]
        for c in range(channels):
            spread[c] += gradient[f, c]
            by_total[c] = gradient[f, channels + c] * share
            by_difference[c] = gradient[f, 2 * channels + c] * share
        for entry in neighbours[f]:
            if entry > 0:
                other, spread_other = table[entry - 1], out[entry - 1]
                for c in range(channels):
                    # The derivative of |x| is its sign: zero at zero, as torch has it.
                    difference = other[c] - own[c]
                    towards = by_difference[c] * ((difference > 0) - (difference < 0))
                    spread_other[c] += by_total[c] + towards
                    spread[c] -= towards
    return out


@kernel
def _gather_means(table: NDArray, index: NDArray[np.int32]) -> NDArray:
    channels = table.shape[1]
    out = np.zeros((len(index), channels), table.dtype)
    for row in range(len(index)):
        share = table.dtype.type(_share(index[row]))
        mean = out[row]
        for entry in index[row]:
            if entry > 0:
                for c in range(channels):
                    mean[c] += table[entry - 1, c]
        for c in range(channels):
            mean[c] *= share
    return out


@kernel
def _spread_means(index: NDArray[np.int32], gradient: NDArray, rows: int) -> NDArray:
    channels = gradient.shape[1]
    out = np.zeros((rows, channels), gradient.dtype)
    for row in range(len(index)):
        share = gradient.dtype.type(_share(index[row]))
        for entry in index[row]:
            if entry > 0:
                for c in range(channels):
                    out[entry - 1, c] += gradient[row, c] * share
    return out
