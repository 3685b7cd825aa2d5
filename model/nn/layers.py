"""The layers of MeshConv3D (paper, section III). Letters: see `model`."""

import torch
from torch import Tensor, nn
from torch.nn.functional import embedding_bag

from meshconv3d.model.nn.cpu_autograd import PatchLinear

# Added to the mean weight of a channel that is zero on all faces of a mesh.
LEAST_WEIGHT = 1e-6


def uses_cpu_autograd(features: Tensor) -> bool:
    """Whether `model.nn.cpu_autograd` gathers patches: in training on a CPU, not in a graph."""
    return features.requires_grad and features.device.type == "cpu"


def with_null_row(features: Tensor) -> Tensor:
    """The feature table by face + 1, with zeros for the null face: N x C -> (N + 1) x C."""
    return torch.cat([features.new_zeros(1, features.shape[1]), features])


def gather_rows(features: Tensor, index: Tensor) -> Tensor:
    """Rows of a feature table by face + 1: N x C, M x W -> M x W x C."""
    rows = with_null_row(features).index_select(0, index.reshape(-1))
    return rows.reshape(index.shape[0], index.shape[1], features.shape[1])


def count_present(index: Tensor, features: Tensor) -> Tensor:
    """Number of faces in each row of an index (M x W): M x 1, of the features' type."""
    return (index > 0).to(features.dtype).sum(dim=1, keepdim=True)


def reciprocal(present: Tensor) -> Tensor:
    """1 / count; 1 for empty rows."""
    return 1 / present.clamp(min=1)


def gather_mean(features: Tensor, index: Tensor) -> Tensor:
    """Mean over the faces in each row of the index: N x C, M x W -> M x C."""
    if features.requires_grad:  # one operation with a quick gradient, which ONNX lacks
        return embedding_bag(index, with_null_row(features), mode="mean", padding_idx=0)
    share = reciprocal(count_present(index, features))
    return gather_rows(features, index).sum(dim=1) * share


def weight_peaks(features: Tensor, index: Tensor) -> Tensor:
    """Features weighted by their own third power, so that their mean is close to their maximum.

    The mean of the result is the Lehmer mean of order 4 of each channel. Unlike a maximum it is a
    sum over faces, and equal faces have equal shares. features: N x C, not negative. index: B x R,
    the faces of each mesh. Returns N x C.
    """
    weights = features**3
    means = gather_mean(weights, index) + LEAST_WEIGHT  # B x C
    # The mesh of each face, by face + 1; the value of the null face is not read.
    owners = index.new_zeros(features.shape[0] + 1, dtype=torch.int64)
    meshes = torch.arange(index.shape[0], device=index.device)[:, None].expand(index.shape)
    owners = owners.scatter(0, index.long().reshape(-1), meshes.reshape(-1))
    return features * weights / means.index_select(0, owners[1:])


class Descriptor(nn.Sequential):
    """Two linear layers over the terms of a face (equations 1 and 2): N x E -> N x C.

    The weights alpha, beta of the paper are matrices 3 -> C, one for each term, which together
    are one matrix over all terms.
    """

    def __init__(self, inputs: int, hidden: int, channels: int) -> None:
        super().__init__(
            nn.Linear(inputs, hidden, bias=False),
            nn.BatchNorm1d(hidden),
            nn.ReLU(),
            nn.Linear(hidden, channels, bias=False),
            nn.BatchNorm1d(channels),
            nn.ReLU(),
        )


class PatchConvolution(nn.Module):
    """Equation 4 with BatchNorm and ReLU: N x C_in, N x K -> N x C_out.

    One matrix over centre, mean over the patch, and mean absolute difference over the patch. With
    `summed`, as in the paper, sums instead of means. Over full patches they differ by a constant
    that BatchNorm absorbs; a mean keeps its scale over the short patches of components with fewer
    than K faces. A missing face adds nothing. The centre is not part of its own patch: the first
    third of the matrix has its share.
    """

    def __init__(self, channels_in: int, channels_out: int, summed: bool = False) -> None:
        super().__init__()
        self.summed = summed
        self.linear = nn.Linear(3 * channels_in, channels_out, bias=False)
        self.norm = nn.BatchNorm1d(channels_out)

    def forward(self, features: Tensor, patches: Tensor) -> Tensor:
        neighbours = patches[:, 1:]
        if uses_cpu_autograd(features):
            mixed = PatchLinear.apply(features, neighbours, self.linear.weight, self.summed)
        else:
            mixed = self.linear(patch_statistics(features, neighbours, self.summed))
        return torch.relu(self.norm(mixed))


def patch_statistics(features: Tensor, neighbours: Tensor, summed: bool = False) -> Tensor:
    """(centre, mean, mean absolute difference), or sums: N x C, N x (K - 1) -> N x 3 C."""
    if neighbours.shape[1] == 0:  # K = 1
        return torch.cat([features, torch.zeros_like(features), torch.zeros_like(features)], dim=1)
    rows = gather_rows(features, neighbours)  # N x (K - 1) x C
    differences = (rows - features[:, None]).abs().sum(dim=1)
    # A missing face reads zeros and has added |centre|: subtract that.
    present = count_present(neighbours, features)
    differences = differences - (neighbours.shape[1] - present) * features.abs()
    if summed:
        return torch.cat([features, rows.sum(dim=1), differences], dim=1)
    share = reciprocal(present)
    return torch.cat([features, rows.sum(dim=1) * share, differences * share], dim=1)
