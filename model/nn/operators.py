"""The topology stage as torch operators, which learned pooling calls between the layers.

They have names, `meshconv3d::grow_patches` and `meshconv3d::pool_faces`, by which they appear in
an exported graph. Neither has a gradient: they choose faces. Arguments and results are those of
`model.topology.batch`.
"""

import torch
from torch import Tensor

from meshconv3d.model.topology import batch as kernels


@torch.library.custom_op("meshconv3d::grow_patches", mutates_args=())
def grow_patches(twin: Tensor, lengths: Tensor, patch_size: int) -> Tensor:
    patches = kernels.grow_patches(twin.cpu().numpy(), lengths.cpu().numpy(), patch_size=patch_size)
    return torch.from_numpy(patches).to(twin.device)


@torch.library.custom_op("meshconv3d::pool_faces", mutates_args=())
def pool_faces(
    features: Tensor,
    twin: Tensor,
    lengths: Tensor,
    starts: Tensor,
    target: int,
    squared_norm: int,
    literal: int,
) -> tuple[Tensor, Tensor, Tensor, Tensor, Tensor]:
    pooled = kernels.pool_faces(
        features.contiguous().cpu().numpy(),
        twin.cpu().numpy(),
        lengths.cpu().numpy(),
        starts.cpu().numpy(),
        target=target,
        squared_norm=squared_norm,
        literal=literal,
    )
    index, shares, twin, lengths, starts = (torch.from_numpy(a).to(features.device) for a in pooled)
    return index, shares, twin, lengths, starts


# What the exporter, which runs no kernel, needs to know: shapes that depend on the data.


@grow_patches.register_fake
def _(twin: Tensor, lengths: Tensor, patch_size: int) -> Tensor:
    return twin.new_empty(twin.shape[0] // 3, patch_size)


@pool_faces.register_fake
def _(
    features: Tensor,
    twin: Tensor,
    lengths: Tensor,
    starts: Tensor,
    target: int,
    squared_norm: int,
    literal: int,
) -> tuple[Tensor, Tensor, Tensor, Tensor, Tensor]:
    context = torch.library.get_ctx()
    faces, width = context.new_dynamic_size(min=1), context.new_dynamic_size(min=1)
    return (
        twin.new_empty(faces, width),
        features.new_empty(faces, width),
        twin.new_empty(3 * faces),
        lengths.new_empty(3 * faces),
        torch.empty_like(starts),
    )
