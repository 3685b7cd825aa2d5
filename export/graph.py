"""The network as it is exported: BatchNorm folded, flat named inputs.

A wrapper of its own, so that the training module stays free of export matters.
"""

import copy
from itertools import pairwise

from torch import Tensor, nn
from torch.nn.utils.fusion import fuse_linear_bn_eval

from model.layers import Descriptor, PatchConvolution
from model.network import Network


class ExportedNetwork(nn.Module):
    """`Network` with the inputs of `model.inputs.input_names`, in order."""

    def __init__(self, network: Network) -> None:
        super().__init__()
        self.network = fold_batch_norm(network)

    def forward(self, terms: Tensor, *indices: Tensor) -> tuple[Tensor, Tensor]:
        levels = self.network.config.levels
        patches, pools, (readout,) = indices[:levels], indices[levels:-1], indices[-1:]
        return self.network(terms, patches, pools, readout)


def fold_batch_norm(network: Network) -> Network:
    """A copy in evaluation mode whose linear layers contain the BatchNorm that follows them."""
    folded = copy.deepcopy(network).eval()
    for module in folded.modules():
        if isinstance(module, PatchConvolution):
            module.linear = fuse_linear_bn_eval(module.linear, module.norm)
            module.norm = nn.Identity()  # type: ignore[assignment]
        elif isinstance(module, Descriptor):
            for i, (linear, norm) in enumerate(pairwise(module)):
                if isinstance(linear, nn.Linear) and isinstance(norm, nn.BatchNorm1d):
                    module[i] = fuse_linear_bn_eval(linear, norm)
                    module[i + 1] = nn.Identity()
    return folded
