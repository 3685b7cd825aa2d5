"""What the network asks of each pooling level, and the two ways to know it.

Under geometric pooling the indices of all levels are inputs. Under learned pooling they come
from the features that enter each pooling (paper, equation 5), by way of `model.nn.operators`.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Protocol

import torch
from torch import Tensor

from meshconv3d.model.config import NetworkConfig
from meshconv3d.model.nn.layers import gather_mean, gather_rows
from meshconv3d.model.nn.operators import grow_patches, pool_faces


class Level(Protocol):
    """One pooling level of a batch."""

    def patches(self) -> Tensor:
        """N_l x K int32 of face + 1."""
        ...

    def pool(self, features: Tensor) -> tuple[Tensor, "Level"]:
        """Pooled features, N_l x C -> N_(l+1) x C, and the next level."""
        ...

    def readout(self) -> Tensor:
        """B x R int32 of face + 1: the faces of each mesh."""
        ...


def first_level(config: NetworkConfig, inputs: Sequence[Tensor]) -> Level:
    """Level 0 from the network's inputs after the terms, as `input_names` orders them."""
    if config.pooling == "learned":
        twin, lengths, starts = inputs
        return GrownLevel(config, 0, twin, lengths, starts)
    count = config.levels
    return GivenLevel(inputs[:count], inputs[count:-1], inputs[-1])


@dataclass(frozen=True)
class GivenLevel:
    """A level whose indices, and those of the levels after it, were known beforehand."""

    later_patches: Sequence[Tensor]
    later_pools: Sequence[Tensor]
    last_readout: Tensor

    def patches(self) -> Tensor:
        return self.later_patches[0]

    def pool(self, features: Tensor) -> tuple[Tensor, "GivenLevel"]:
        rest = GivenLevel(self.later_patches[1:], self.later_pools[1:], self.last_readout)
        return gather_mean(features, self.later_pools[0]), rest

    def readout(self) -> Tensor:
        return self.last_readout


@dataclass(frozen=True)
class GrownLevel:
    """A level whose indices follow from its surface and from the features.

    twin, 3 N int32; lengths, 3 N float64; starts, B + 1 int32: a `SurfaceBatch`.
    """

    config: NetworkConfig
    number: int
    twin: Tensor
    lengths: Tensor
    starts: Tensor

    def patches(self) -> Tensor:
        return grow_patches(self.twin, self.lengths, self.config.patch_size)

    def pool(self, features: Tensor) -> tuple[Tensor, "GrownLevel"]:
        options = self.config.topology_options
        # Which faces collapse is a choice, and has no gradient; what they gather has one.
        index, shares, twin, lengths, starts = pool_faces(
            features.detach(),
            self.twin,
            self.lengths,
            self.starts,
            self.config.targets[self.number],
            options.squared_norm,
            options.literal,
        )
        pooled = (gather_rows(features, index) * shares[:, :, None]).sum(dim=1)
        number = self.number + 1
        return pooled, replace(self, number=number, twin=twin, lengths=lengths, starts=starts)

    def readout(self) -> Tensor:
        first, counts = self.starts[:-1, None], self.starts.diff()[:, None]
        longest = counts.max().item()
        torch._check(longest >= 0)  # which the exporter cannot see
        column = torch.arange(longest, dtype=torch.int32, device=counts.device)[None]
        return torch.where(column < counts, first + column + 1, 0)
