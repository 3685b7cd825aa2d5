"""The convolution over patches with its gradient, for training on a CPU.

In torch operations a patch is a tensor of N x K x C, and every step of the arithmetic keeps another
one for the gradient. These compiled loops gather a block of faces that fits the cache, multiply it
and discard it; the gradient gathers it again. That halves a training step and its memory.
`model.nn.layers` has the same arithmetic in torch operations, for the exported graph and for other
devices, with the same values and gradients.
"""

from collections.abc import Iterator

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor
from torch.autograd.function import once_differentiable

from meshconv3d.model.jit import kernel

# Faces in a block: 3 MB for 3 x 256 channels.
BLOCK = 1024


class PatchLinear(torch.autograd.Function):
    """`patch_statistics` of `model.nn.layers` times a matrix.

    N x C_in, N x (K - 1), C_out x 3 C_in -> N x C_out.
    """

    @staticmethod
    def forward(ctx, features: Tensor, neighbours: Tensor, weight: Tensor, summed: bool) -> Tensor:
        table, index = features.detach().contiguous(), neighbours.contiguous()
        ctx.save_for_backward(table, index, weight)
        ctx.summed = summed
        out = table.new_empty(len(table), len(weight))
        for first, statistics in _blocks(table, index, summed):
            torch.mm(statistics, weight.T, out=out[first : first + len(statistics)])
        return out

    @staticmethod
    @once_differentiable
    def backward(ctx, gradient: Tensor) -> tuple[Tensor, None, Tensor, None]:
        table, index, weight = ctx.saved_tensors
        spread, by_weight = torch.zeros_like(table), torch.zeros_like(weight)
        for first, statistics in _blocks(table, index, ctx.summed):
            rows = gradient[first : first + len(statistics)]
            by_weight.addmm_(rows.T, statistics)
            by_statistics = torch.mm(rows, weight, out=statistics)
            _spread_patches(
                table.numpy(),
                index.numpy(),
                first,
                by_statistics.numpy(),
                ctx.summed,
                spread.numpy(),
            )
        return spread, None, by_weight, None


def _blocks(table: Tensor, index: Tensor, summed: bool) -> Iterator[tuple[int, Tensor]]:
    """The first face and the patch statistics of each block; all blocks share one buffer."""
    rows, channels = table.shape
    statistics = table.new_empty(min(BLOCK, rows), 3 * channels)
    for first in range(0, rows, BLOCK):
        block = statistics[: rows - first]
        _gather_patches(table.numpy(), index.numpy(), first, summed, block.numpy())
        yield first, block


@kernel
def _share(index: NDArray[np.int32]) -> float:
    """1 / number of faces in a row of an index; 1 for an empty row."""
    present = 0
    for entry in index:
        present += entry > 0
    return 1.0 / max(present, 1)


@kernel
def _gather_patches(
    table: NDArray, neighbours: NDArray[np.int32], first: int, summed: bool, out: NDArray
) -> None:
    """Write the statistics of the faces from `first` on into `out`, rows x 3 C."""
    channels = table.shape[1]
    for row in range(len(out)):
        f = first + row
        share = table.dtype.type(1.0 if summed else _share(neighbours[f]))
        own = table[f]
        total, difference = out[row, channels : 2 * channels], out[row, 2 * channels :]
        out[row, :channels] = own
        total[:] = 0
        difference[:] = 0
        for entry in neighbours[f]:
            if entry > 0:
                other = table[entry - 1]
                for c in range(channels):
                    total[c] += other[c]
                    difference[c] += abs(other[c] - own[c])
        for c in range(channels):
            total[c] *= share
            difference[c] *= share


@kernel
def _spread_patches(
    table: NDArray,
    neighbours: NDArray[np.int32],
    first: int,
    gradient: NDArray,
    summed: bool,
    out: NDArray,
) -> None:
    """Add to `out`, N x C, the gradient (rows x 3 C) of the faces from `first` on."""
    channels = table.shape[1]
    by_difference = np.empty(channels, table.dtype)
    by_total = np.empty(channels, table.dtype)
    for row in range(len(gradient)):
        f = first + row
        share = table.dtype.type(1.0 if summed else _share(neighbours[f]))
        own, spread = table[f], out[f]
        for c in range(channels):
            spread[c] += gradient[row, c]
            by_total[c] = gradient[row, channels + c] * share
            by_difference[c] = gradient[row, 2 * channels + c] * share
        for entry in neighbours[f]:
            if entry > 0:
                other, spread_other = table[entry - 1], out[entry - 1]
                for c in range(channels):
                    # The derivative of |x| is its sign, 0 at 0 as in torch.
                    difference = other[c] - own[c]
                    towards = by_difference[c] * ((difference > 0) - (difference < 0))
                    spread_other[c] += by_total[c] + towards
                    spread[c] -= towards
