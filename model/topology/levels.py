"""All pooling levels of one mesh, known before the network runs."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from meshconv3d.model.topology.pooling import gather_mean
from meshconv3d.model.topology.surface import DEFAULT_OPTIONS, Surface, TopologyOptions


@dataclass(frozen=True, eq=False)
class Topology:
    """The indices of every level of one mesh.

    patches: L arrays, F_l x K int32. pools: L arrays, F_(l+1) x W_l int32, from level l to
    level l + 1. Entries are face + 1 within their level; 0 is the null face.
    """

    patches: tuple[NDArray[np.int32], ...]
    pools: tuple[NDArray[np.int32], ...]

    @property
    def face_counts(self) -> tuple[int, ...]:
        """Faces of every level, L + 1 numbers."""
        return (len(self.patches[0]), *(len(pool) for pool in self.pools))


def build_topology(
    surface: Surface,
    features: NDArray,
    patch_size: int,
    targets: Sequence[int],
    options: TopologyOptions = DEFAULT_OPTIONS,
) -> Topology:
    """All levels under the `geometric` reading of equation 5.

    features: F_0 x C, the fixed geometric features of the input; they are averaged along with
    the pooling and weigh the faces of every level. targets: one face count for each level.
    """
    patches, pools = [], []
    for target in targets:
        if pools:
            features = gather_mean(features, pools[-1])
        patches.append(surface.patches(patch_size))
        surface, index, _ = surface.pool(features, target, options)
        pools.append(index)
    return Topology(tuple(patches), tuple(pools))
