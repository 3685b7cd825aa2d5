"""The learned parts of MeshConv3D (paper, section III). Letters: see `model`."""

import torch
from torch import Tensor, nn

from meshconv3d.model.nn.cpu_autograd import GatherMean, PatchLinear

# Added to the mean weight of a channel that no face of a mesh has anything in.
LEAST_WEIGHT = 1e-6


def is_fused(features: Tensor) -> bool:
    """Whether to gather by compiled loops: in training on a CPU. A graph has operations only."""
    return features.requires_grad and features.device.type == "cpu"


def gather_rows(features: Tensor, index: Tensor) -> Tensor:
    """Rows of a feature table by face + 1; 0, the null face, reads zeros.

    features: N x C. index: M x W. Returns M x W x C. The one place that knows the null row.
    """
    table = torch.cat([features.new_zeros(1, features.shape[1]), features])
    rows = table.index_select(0, index.reshape(-1))
    return rows.reshape(index.shape[0], index.shape[1], features.shape[1])


def count_present(index: Tensor, features: Tensor) -> Tensor:
    """How many entries of each row of an index (M x W) are faces: M x 1, of the features' type."""
    return (index > 0).to(features.dtype).sum(dim=1, keepdim=True)


def shares(present: Tensor) -> Tensor:
    """What each of so many faces is of their mean; of none, one."""
    return 1 / present.clamp(min=1)


def gather_mean(features: Tensor, index: Tensor) -> Tensor:
    """Mean over the faces that each row of the index names. N x C, M x W -> M x C."""
    if is_fused(features):
        return GatherMean.apply(features, index)
    share = shares(count_present(index, features))
    return gather_rows(features, index).sum(dim=1) * share


def mesh_mean(features: Tensor, index: Tensor) -> Tensor:
    """`gather_mean` over few rows of many faces: N x C, B x R -> B x C.

    A product, which onnxruntime has ready sooner than a sum over so long an axis.
    """
    if is_fused(features):
        return gather_mean(features, index)
    # The null face reads zeros: its share does no harm.
    weights = shares(count_present(index, features))[:, None].expand(-1, 1, index.shape[1])
    return (weights @ gather_rows(features, index)).squeeze(1)


def spread_peaks(features: Tensor, index: Tensor) -> Tensor:
    """Features weighed by their own third power, so that their mean is close to their maximum.

    That mean is the Lehmer mean of order 4 of each channel: unlike a maximum it is a sum over
    faces, and faces that are alike share it. features: N x C, none below zero. index: B x R, the
    faces of each mesh. Returns N x C.
    """
    weights = features**3
    means = mesh_mean(weights, index) + LEAST_WEIGHT  # B x C
    # Which mesh a face is of, by face + 1; whatever the null face gets, nobody reads.
    owners = index.new_zeros(features.shape[0] + 1, dtype=torch.int64)
    meshes = torch.arange(index.shape[0], device=index.device)[:, None].expand(index.shape)
    owners = owners.scatter(0, index.long().reshape(-1), meshes.reshape(-1))
    return features * weights / means.index_select(0, owners[1:])


class Descriptor(nn.Sequential):
    """Two linear layers over what is listed of a face (equations 1 and 2). N x E -> N x C.

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

    Centre, mean over the patch, and mean absolute difference over the patch; a matrix each,
    stacked into one. Where not `summed` as in the paper, sums are means over the faces that are
    there: for a full patch a constant that BatchNorm absorbs, and a short patch (a component of
    fewer than K faces) keeps its scale. A missing face adds nothing to either. The centre itself
    is left out of the patch: its share is in the first matrix already.
    """

    def __init__(self, channels_in: int, channels_out: int, summed: bool = False) -> None:
        super().__init__()
        self.summed = summed
        self.linear = nn.Linear(3 * channels_in, channels_out, bias=False)
        self.norm = nn.BatchNorm1d(channels_out)

    def forward(self, features: Tensor, patches: Tensor) -> Tensor:
        neighbours = patches[:, 1:]
        if is_fused(features):
            mixed = PatchLinear.apply(features, neighbours, self.linear.weight, self.summed)
        else:
            mixed = self.linear(patch_statistics(features, neighbours, self.summed))
        return torch.relu(self.norm(mixed))


def patch_statistics(features: Tensor, neighbours: Tensor, summed: bool = False) -> Tensor:
    """(centre, mean, mean absolute difference): N x C, N x (K - 1) -> N x 3 C; or sums."""
    if neighbours.shape[1] == 0:  # K = 1
        return torch.cat([features, torch.zeros_like(features), torch.zeros_like(features)], dim=1)
    rows = gather_rows(features, neighbours)  # N x (K - 1) x C
    differences = (rows - features[:, None]).abs().sum(dim=1)
    # A null row reads zeros, so that each missing face has added |centre|: take that off again.
    present = count_present(neighbours, features)
    differences = differences - (neighbours.shape[1] - present) * features.abs()
    if summed:
        return torch.cat([features, rows.sum(dim=1), differences], dim=1)
    share = shares(present)
    return torch.cat([features, rows.sum(dim=1) * share, differences * share], dim=1)
