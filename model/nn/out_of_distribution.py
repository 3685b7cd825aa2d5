"""Out-of-distribution score: the distance of a mesh's features from those of training meshes.

A softmax is certain of any point far from all classes; a distance in feature space is not. The
score is the relative Mahalanobis distance of Ren et al., *A Simple Fix to Mahalanobis Distance for
Improving Near-OOD Detection* (2021): the distance to the nearest class minus the distance to all
classes as one. `benchmarks.unknown` compares it with other scores.
"""

import torch
from torch import Tensor, nn

# Added to the diagonal of each covariance, as a share of its mean eigenvalue: there are more
# channels than independent meshes.
SHRINKAGE = 0.1


class Novelty(nn.Module):
    """Relative Mahalanobis distance of pooled features: B x C -> B.

    `fit` measures its parameters after training; before that, it is zero.
    """

    centre: Tensor
    within: Tensor
    overall: Tensor
    means: Tensor

    def __init__(self, channels: int, classes: int) -> None:
        super().__init__()
        self.register_buffer("centre", torch.zeros(channels))
        # Whitening matrices: within-class and total covariance.
        self.register_buffer("within", torch.zeros(channels, channels))
        self.register_buffer("overall", torch.zeros(channels, channels))
        self.register_buffer("means", torch.zeros(classes, channels))

    def forward(self, features: Tensor) -> Tensor:
        offset = features - self.centre
        to_classes = (offset @ self.within)[:, None] - self.means  # B x N_c x C
        nearest = to_classes.square().sum(dim=2).amin(dim=1)
        return nearest - (offset @ self.overall).square().sum(dim=1)

    def fit(self, features: Tensor, labels: Tensor) -> None:
        """Measure means and covariances on the features (M x C) of training meshes."""
        features = features.double()
        self.centre.copy_(features.mean(dim=0))
        offset = features - features.mean(dim=0)
        means = torch.stack([offset[labels == c].mean(dim=0) for c in range(len(self.means))])
        within = _whitening(offset - means[labels])
        self.within.copy_(within)
        self.overall.copy_(_whitening(offset))
        self.means.copy_(means @ within)


def _whitening(offset: Tensor) -> Tensor:
    """The symmetric matrix, C x C, that gives offsets (M x C) unit covariance."""
    covariance = offset.T @ offset / len(offset)
    spread = covariance.diagonal().mean().clamp(min=1e-12)
    values, vectors = torch.linalg.eigh(
        covariance + SHRINKAGE * spread * torch.eye(len(covariance))
    )
    return vectors / values.sqrt() @ vectors.T
