"""The network as it is exported: with BatchNorm folded."""

import copy
from itertools import pairwise

from torch import nn
from torch.nn.utils.fusion import fuse_linear_bn_eval

from meshconv3d.model.nn.layers import Descriptor, PatchConvolution
from meshconv3d.model.nn.network import Network


def fold_batch_norm(network: Network) -> Network:
    """A copy in evaluation mode whose linear layers contain the BatchNorm that follows them."""
    folded = copy.deepcopy(network).eval().requires_grad_(False)
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
