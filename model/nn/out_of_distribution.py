"""How unlike everything it was trained on a mesh is, from the features that are classified.

A softmax is sure of anything far away; distance in feature space is not. The measure is the
relative Mahalanobis distance of Ren et al., *A Simple Fix to Mahalanobis Distance for Improving
Near-OOD Detection* (2021): to the nearest class, less the distance to all classes as one.
`benchmarks.unknown` compares it with others.
"""

import torch
from torch import Tensor, nn

# Of each covariance, in shares of its mean eigenvalue: there are more directions than meshes fill.
SHRINKAGE = 0.1


class Novelty(nn.Module):
    """Relative Mahalanobis distance: pooled features, B x C -> B.

    Its numbers are measured after training, by `fit`, not learned. Before, it is zero.
    """

    centre: Tensor
    within: Tensor
    overall: Tensor
    means: Tensor

    def __init__(self, channels: int, classes: int) -> None:
        super().__init__()
        self.register_buffer("centre", torch.zeros(channels))
        # What makes features round: as they scatter within their classes, and altogether.
        self.register_buffer("within", torch.zeros(channels, channels))
        self.register_buffer("overall", torch.zeros(channels, channels))
        self.register_buffer("means", torch.zeros(classes, channels))

    def forward(self, features: Tensor) -> Tensor:
        offset = features - self.centre
        to_classes = (offset @ self.within)[:, None] - self.means  # B x N_c x C
        nearest = to_classes.square().sum(dim=2).amin(dim=1)
        return nearest - (offset @ self.overall).square().sum(dim=1)

    def fit(self, features: Tensor, labels: Tensor) -> None:
        """Measure classes on the features, M x C, of meshes that the network was trained on."""
        features = features.double()
        self.centre.copy_(features.mean(dim=0))
        offset = features - features.mean(dim=0)
        means = torch.stack([offset[labels == c].mean(dim=0) for c in range(len(self.means))])
        within = _whitening(offset - means[labels])
        self.within.copy_(within)
        self.overall.copy_(_whitening(offset))
        self.means.copy_(means @ within)


def _whitening(offset: Tensor) -> Tensor:
    """The matrix that gives offsets (M x C) unit covariance: C x C, symmetric."""
    covariance = offset.T @ offset / len(offset)
    spread = covariance.diagonal().mean().clamp(min=1e-12)
    values, vectors = torch.linalg.eigh(
        covariance + SHRINKAGE * spread * torch.eye(len(covariance))
    )
    return vectors / values.sqrt() @ vectors.T
