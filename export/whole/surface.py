"""The pooling levels of one mesh: every index by which the network gathers features."""

from typing import NamedTuple

from meshconv3d.export.whole.arrays import Array
from meshconv3d.export.whole.halfedges import grow_patches, sort_adjacency
from meshconv3d.export.whole.pooling import gather_mean, pool_faces
from meshconv3d.model.config import NetworkConfig


class Topology(NamedTuple):
    """As in `model.topology.surface`, int64: of each level, patches and pooling index. last: F_L,
    a number."""

    patches: list[Array]
    pools: list[Array]
    last: Array


def build_topology(
    faces: Array,
    twin: Array,
    lengths: Array,
    features: Array,
    vertex_count: Array,
    config: NetworkConfig,
) -> Topology:
    """All levels under geometric pooling.

    faces: F_0 x 3. twin: H. lengths: H float64. features: F_0 x C float32, those of equation 5.
    """
    patches, pools = [], []
    squared = config.pooling_norm == "squared"
    for target in config.targets:
        if pools:
            features = gather_mean(features, pools[-1])
        patches.append(grow_patches(sort_adjacency(twin, lengths), config.patch_size))
        pooled = pool_faces(faces, twin, features, vertex_count, target, squared)
        faces, twin = pooled.faces, pooled.twin
        lengths = lengths.reshape(-1, 3)[pooled.kept].reshape(-1)
        pools.append(pooled.index)
    return Topology(patches, pools, faces.size())
