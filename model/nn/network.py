"""MeshConv3D: descriptors, blocks of convolution and pooling, and an additive readout."""

from collections.abc import Mapping
from itertools import pairwise
from typing import NamedTuple

import torch
from numpy.typing import NDArray
from torch import Tensor, nn

from meshconv3d.model.config import NetworkConfig
from meshconv3d.model.nn.feature_space import Embedding, Novelty
from meshconv3d.model.nn.layers import Descriptor, PatchConvolution, gather_mean, weight_peaks
from meshconv3d.model.nn.levels import first_level
from meshconv3d.model.topology.descriptors import GEODESIC_TERMS, GEOMETRIC_TERMS
from meshconv3d.model.topology.integral_invariants import MEASURES


class Outputs(NamedTuple):
    """Outputs of the network for a batch.

    scores: B x N_c, logits. evidence: N_L x N_c, the share of each face of the last level: a
    mesh's scores are the bias plus the mean of its evidence. novelty: B, the out-of-distribution
    score. embedding: B x A, of unit length. For both see `model.nn.feature_space`.
    """

    scores: Tensor
    evidence: Tensor
    novelty: Tensor
    embedding: Tensor


class Network(nn.Module):
    """The classifier of the paper's section IV, over a ragged batch of meshes.

    Inputs are the arrays of `model.topology.inputs.collate` as tensors, in the order of
    `input_names`: terms, N_0 x E, then the indices or surfaces that the levels need.
    """

    def __init__(self, config: NetworkConfig) -> None:
        super().__init__()
        self.config = config
        hidden, channels = config.descriptor_hidden, config.descriptor_channels
        self.geodesic = Descriptor(3 * len(GEODESIC_TERMS), hidden, channels)
        self.geometric = Descriptor(3 * len(GEOMETRIC_TERMS), hidden, channels)
        self.descriptors = [self.geodesic, self.geometric]
        if config.integral_invariants:
            self.integral_invariants = Descriptor(MEASURES, hidden, channels)
            self.descriptors.append(self.integral_invariants)
        summed = config.patch_reduction == "sum"
        widths = (len(self.descriptors) * channels, *config.channels)
        self.blocks = nn.ModuleList(
            nn.ModuleList(
                PatchConvolution(width_in if i == 0 else width_out, width_out, summed)
                for i in range(config.convolutions)
            )
            for width_in, width_out in pairwise(widths)
        )
        width = widths[-1] * (2 if config.readout == "mean-peak" else 1)
        self.dropout = nn.Dropout(config.dropout)
        self.classify = nn.Linear(width, len(config.classes))
        self.novelty = Novelty(width, len(config.classes))
        self.embedding = Embedding(width)

    def take_features(self, other: "Network") -> None:
        """Copy the weights of another network, and those of its classes where they are the same.

        Both have the same configuration, except for the classes.
        """
        left = ("novelty.", "embedding.")
        if other.config.classes != self.config.classes:
            left += ("classify.",)
        kept = {k: v for k, v in other.state_dict().items() if not k.startswith(left)}
        self.load_state_dict(self.state_dict() | kept)

    def forward(self, terms: Tensor, *topology: Tensor) -> Outputs:
        features, pooled = self.features(terms, *topology)
        evidence = features @ self.classify.weight.T
        return Outputs(
            self.classify(self.dropout(pooled)),
            evidence,
            self.novelty(pooled),
            self.embedding(pooled),
        )

    def features(self, terms: Tensor, *topology: Tensor) -> tuple[Tensor, Tensor]:
        """The features that are classified, N_L x C, and their mean over each mesh, B x C."""
        # Equation 3: the descriptors side by side, N_0 x 2 C or 3 C.
        parts = terms.split([descriptor[0].in_features for descriptor in self.descriptors], dim=1)
        features = torch.cat(
            [describe(part) for describe, part in zip(self.descriptors, parts, strict=True)], dim=1
        )
        level = first_level(self.config, topology)
        for block in self.blocks:
            patches = level.patches()  # N_l x K
            assert isinstance(block, nn.ModuleList)
            for convolution in block:
                features = convolution(features, patches)  # N_l x C
            features, level = level.pool(features)  # N_(l+1) x C
        readout = level.readout()
        if self.config.readout == "mean-peak":
            features = torch.cat([features, weight_peaks(features, readout)], dim=1)
        return features, gather_mean(features, readout)


def as_tensors(
    arrays: Mapping[str, NDArray], device: torch.device | str = "cpu"
) -> tuple[Tensor, ...]:
    """The arguments of `Network.forward` from the arrays of `collate`."""
    return tuple(torch.from_numpy(array).to(device) for array in arrays.values())
