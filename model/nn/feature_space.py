"""Where a mesh lies in the space of pooled features: its out-of-distribution score and embedding.

Both are measured on the features of training meshes once training has ended; no gradient is used.
"""

import torch
from torch import Tensor, nn
from torch.nn.functional import normalize

# Added to the diagonal of each covariance, as a share of its mean eigenvalue: there are more
# channels than independent meshes.
SHRINKAGE = 0.1
# Numbers of an embedding, where the network has so many channels.
EMBEDDING_SIZE = 128


class Novelty(nn.Module):
    """Out-of-distribution score of pooled features: B x C -> B.

    A softmax is certain of any point far from all classes; a distance in feature space is not. The
    score is the relative Mahalanobis distance of Ren et al., *A Simple Fix to Mahalanobis Distance
    for Improving Near-OOD Detection* (2021): the distance to the nearest class minus the distance
    to all classes as one. Where meshes of no class were there to measure, the latter is the mean of
    itself and the distance to the nearest of these. `benchmarks.unknown` compares it with others.

    `fit` measures its parameters after training; before that, it is zero.
    """

    centre: Tensor
    within: Tensor
    overall: Tensor
    means: Tensor
    others: Tensor

    def __init__(self, channels: int, classes: int) -> None:
        super().__init__()
        self.register_buffer("centre", torch.zeros(channels))
        # Whitening matrices: within-class and total covariance.
        self.register_buffer("within", torch.zeros(channels, channels))
        self.register_buffer("overall", torch.zeros(channels, channels))
        self.register_buffer("means", torch.zeros(classes, channels))
        self.make_room(0)

    def make_room(self, others: int) -> None:
        """Have room for so many meshes of no class."""
        self.register_buffer("others", self.centre.new_zeros(others, len(self.centre)))

    def forward(self, features: Tensor) -> Tensor:
        offset = features - self.centre
        whitened = offset @ self.within
        background = (offset @ self.overall).square().sum(dim=1)
        if len(self.others):
            background = (background + _nearest(whitened, self.others)) / 2
        return _nearest(whitened, self.means) - background

    def fit(self, features: Tensor, labels: Tensor, others: Tensor | None = None) -> None:
        """Measure means and covariances on the features (M x C) of training meshes.

        others: features of meshes of no class, N_o x C, if there are any.
        """
        features = features.double()
        self.centre.copy_(features.mean(dim=0))
        offset = features - features.mean(dim=0)
        means = _means(offset, labels)
        within = _whitening(offset - means[labels])
        self.within.copy_(within)
        self.overall.copy_(_whitening(offset))
        self.means.copy_(means @ within)
        if others is not None:
            self.make_room(len(others))
            self.others.copy_((others.double() - features.mean(dim=0)) @ within)


class Embedding(nn.Module):
    """Coordinates of a mesh among all shapes, for search: pooled features, B x C -> B x A.

    Each row has unit length, so that the inner product of two is their cosine. The axes are those
    of a linear discriminant analysis that takes every training mesh, with its varied copies, for a
    class of its own: what changes with the triangles of a mesh counts little, what differs between
    meshes counts most.

    `fit` measures its parameters after training; before that, all embeddings are zero.
    """

    centre: Tensor
    projection: Tensor

    def __init__(self, channels: int) -> None:
        super().__init__()
        self.register_buffer("centre", torch.zeros(channels))
        self.register_buffer("projection", torch.zeros(channels, min(channels, EMBEDDING_SIZE)))

    def forward(self, features: Tensor) -> Tensor:
        return normalize((features - self.centre) @ self.projection)

    def fit(self, features: Tensor, meshes: Tensor) -> None:
        """Measure the axes on the features (M x C) of training meshes and their copies.

        meshes: M, the number of the mesh that each is, or is a copy of, from 0 on.
        """
        features = features.double()
        self.centre.copy_(features.mean(dim=0))
        offset = features - features.mean(dim=0)
        means = _means(offset, meshes)
        whitening = _whitening(offset - means[meshes])
        between = means @ whitening
        _, axes = torch.linalg.eigh(between.T @ between)
        self.projection.copy_(whitening @ axes.flip(1)[:, : self.projection.shape[1]])


def _nearest(points: Tensor, means: Tensor) -> Tensor:
    """Squared distance of each point, B x C, to the nearest of some others, N x C."""
    return (points[:, None] - means).square().sum(dim=2).amin(dim=1)


def _means(offset: Tensor, groups: Tensor) -> Tensor:
    """Mean offset of each group, G x C. groups: M, from 0 to G - 1."""
    counts = torch.bincount(groups)
    sums = offset.new_zeros(len(counts), offset.shape[1]).index_add(0, groups, offset)
    return sums / counts[:, None]


def _whitening(offset: Tensor) -> Tensor:
    """The symmetric matrix, C x C, that gives offsets (M x C) unit covariance."""
    covariance = offset.T @ offset / len(offset)
    spread = covariance.diagonal().mean().clamp(min=1e-12)
    values, vectors = torch.linalg.eigh(
        covariance + SHRINKAGE * spread * torch.eye(len(covariance))
    )
    return vectors / values.sqrt() @ vectors.T
