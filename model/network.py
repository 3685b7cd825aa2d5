"""MeshConv3D: descriptors, blocks of convolution and pooling, and an additive readout."""

from collections.abc import Sequence
from itertools import pairwise

import torch
from torch import Tensor, nn

from model.config import NetworkConfig
from model.descriptors import GEODESIC_TERMS, GEOMETRIC_TERMS
from model.layers import Descriptor, PatchConvolution, gather_mean


class Network(nn.Module):
    """The classifier of the paper's section IV, over a ragged batch of meshes.

    Inputs are those of `model.inputs.collate`, as tensors. Call it with terms, N_0 x 3 D, and
    for each level the patches, N_l x K, and pools, N_(l+1) x W_l; then readout, B x R.

    Returns (scores, evidence): scores, B x N_c, are logits; evidence, N_L x N_c, is what each
    face of the last level says: a mesh's scores are the bias plus the mean of its evidence.
    """

    def __init__(self, config: NetworkConfig) -> None:
        super().__init__()
        self.config = config
        hidden, channels = config.descriptor_hidden, config.descriptor_channels
        self.geodesic = Descriptor(len(GEODESIC_TERMS), hidden, channels)
        self.geometric = Descriptor(len(GEOMETRIC_TERMS), hidden, channels)
        widths = (2 * channels, *config.channels)
        self.blocks = nn.ModuleList(
            nn.ModuleList(
                PatchConvolution(width_in if i == 0 else width_out, width_out)
                for i in range(config.convolutions)
            )
            for width_in, width_out in pairwise(widths)
        )
        self.classify = nn.Linear(widths[-1], len(config.classes))

    def forward(
        self, terms: Tensor, patches: Sequence[Tensor], pools: Sequence[Tensor], readout: Tensor
    ) -> tuple[Tensor, Tensor]:
        split = 3 * len(GEODESIC_TERMS)
        # Equation 3: both descriptors side by side, N_0 x 2 C.
        features = torch.cat(
            [self.geodesic(terms[:, :split]), self.geometric(terms[:, split:])], dim=1
        )
        for block, level_patches, pool in zip(self.blocks, patches, pools, strict=True):
            assert isinstance(block, nn.ModuleList)
            for convolution in block:
                features = convolution(features, level_patches)  # N_l x C
            features = gather_mean(features, pool)  # N_(l+1) x C
        evidence = features @ self.classify.weight.T  # N_L x N_c
        return gather_mean(evidence, readout) + self.classify.bias, evidence


def as_tensors(
    arrays: dict, levels: int, device: torch.device | str = "cpu"
) -> tuple[Tensor, list[Tensor], list[Tensor], Tensor]:
    """The arguments of `Network.forward` from the arrays of `collate`."""
    tensors = {name: torch.from_numpy(array).to(device) for name, array in arrays.items()}
    return (
        tensors["terms"],
        [tensors[f"patches_{level}"] for level in range(levels)],
        [tensors[f"pools_{level}"] for level in range(levels)],
        tensors["readout"],
    )
