"""Pooling levels of the network: patches, pooling and readout of each.

Under geometric pooling the indices of all levels are inputs. Under learned pooling they follow
from the features that enter each pooling (paper, equation 5): the topology stage is then called
between the layers, as torch operators `meshconv3d::grow_patches` and `meshconv3d::pool_faces`.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import torch
from torch import Tensor

from meshconv3d.model.config import NetworkConfig
from meshconv3d.model.nn.layers import gather_mean, gather_rows
from meshconv3d.model.topology import batch as kernels


def first_level(config: NetworkConfig, inputs: Sequence[Tensor]) -> "Level":
    """Level 0 from the network's inputs after the terms, in the order of `input_names`."""
    if config.pooling == "learned":
        faces, lengths, starts = inputs
        return LearnedLevel(config, 0, faces, lengths, starts)
    count = config.levels
    return GeometricLevel(inputs[:count], inputs[count:-1], inputs[-1])


@dataclass(frozen=True)
class GeometricLevel:
    """A level whose indices, and those of all later levels, are inputs."""

    later_patches: Sequence[Tensor]
    later_pools: Sequence[Tensor]
    last_readout: Tensor

    def patches(self) -> Tensor:
        """N_l x K int32 of face + 1."""
        return self.later_patches[0]

    def pool(self, features: Tensor) -> tuple[Tensor, "GeometricLevel"]:
        """Pooled features, N_l x C -> N_(l+1) x C, and the next level."""
        rest = GeometricLevel(self.later_patches[1:], self.later_pools[1:], self.last_readout)
        return gather_mean(features, self.later_pools[0]), rest

    def readout(self) -> Tensor:
        """B x R int32 of face + 1: the faces of each mesh."""
        return self.last_readout


@dataclass(frozen=True)
class LearnedLevel:
    """A level with the methods of `GeometricLevel`, from its surface and the features.

    faces, N x 3 int32; lengths, 3 N float64; starts, B + 1 int32: a `SurfaceBatch`.
    """

    config: NetworkConfig
    number: int
    faces: Tensor
    lengths: Tensor
    starts: Tensor

    def patches(self) -> Tensor:
        return grow_patches(self.faces, self.lengths, self.config.patch_size)

    def pool(self, features: Tensor) -> tuple[Tensor, "LearnedLevel"]:
        options = self.config.topology_options
        # The choice of the collapsed faces has no gradient; the mean that replaces them has one.
        index, shares, faces, lengths, starts = pool_faces(
            features.detach(),
            self.faces,
            self.lengths,
            self.starts,
            self.config.targets[self.number],
            options.squared_norm,
            options.literal,
        )
        pooled = (gather_rows(features, index) * shares[:, :, None]).sum(dim=1)
        number = self.number + 1
        return pooled, replace(self, number=number, faces=faces, lengths=lengths, starts=starts)

    def readout(self) -> Tensor:
        first, counts = self.starts[:-1, None], self.starts.diff()[:, None]
        longest = counts.max().item()
        torch._check(longest >= 0)  # the exporter cannot infer it
        column = torch.arange(longest, dtype=torch.int32, device=counts.device)[None]
        return torch.where(column < counts, first + column + 1, 0)


Level = GeometricLevel | LearnedLevel


@torch.library.custom_op("meshconv3d::grow_patches", mutates_args=())
def grow_patches(faces: Tensor, lengths: Tensor, patch_size: int) -> Tensor:
    """`model.topology.batch.grow_patches` on tensors."""
    patches = kernels.grow_patches(
        faces.cpu().numpy(), lengths.cpu().numpy(), patch_size=patch_size
    )
    return torch.from_numpy(patches).to(faces.device)


@torch.library.custom_op("meshconv3d::pool_faces", mutates_args=())
def pool_faces(
    features: Tensor,
    faces: Tensor,
    lengths: Tensor,
    starts: Tensor,
    target: int,
    squared_norm: int,
    literal: int,
) -> tuple[Tensor, Tensor, Tensor, Tensor, Tensor]:
    """`model.topology.batch.pool_faces` on tensors."""
    pooled = kernels.pool_faces(
        features.contiguous().cpu().numpy(),
        faces.cpu().numpy(),
        lengths.cpu().numpy(),
        starts.cpu().numpy(),
        target=target,
        squared_norm=squared_norm,
        literal=literal,
    )
    index, shares, faces, lengths, starts = (
        torch.from_numpy(a).to(features.device) for a in pooled
    )
    return index, shares, faces, lengths, starts
