"""The pooling levels of one mesh: every index by which the network gathers features."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from meshconv3d.model.mesh import Mesh
from meshconv3d.model.topology.halfedges import (
    edge_lengths,
    find_twins,
    grow_patches,
    sort_adjacency,
)
from meshconv3d.model.topology.pooling import gather_mean, pool_faces


@dataclass(frozen=True)
class TopologyOptions:
    """Options of pooling: `squared_norm` and `literal`, see `pool_faces`."""

    squared_norm: bool = True
    literal: bool = False


DEFAULT_OPTIONS = TopologyOptions()


@dataclass(frozen=True, eq=False)
class Surface:
    """Connectivity and side lengths of the faces of one pooling level.

    faces: F x 3 int32, their corners, in one orientation. twin: H int32, the half-edge across each
    edge or -1. lengths: H float64, in mesh units; a pooled face keeps the side lengths that it had
    in the prepared mesh.
    """

    faces: NDArray[np.int32]
    twin: NDArray[np.int32]
    lengths: NDArray[np.float64]

    @classmethod
    def of(cls, mesh: Mesh) -> "Surface":
        """The surface of a prepared mesh."""
        # A copy: kernels are compiled anew for arrays that are read-only.
        return cls.over(mesh.faces.copy(), edge_lengths(mesh.vertices, mesh.faces))

    @classmethod
    def over(cls, faces: NDArray[np.int32], lengths: NDArray[np.float64]) -> "Surface":
        """The surface of manifold faces, none of them degenerate or twice."""
        twin, _, _ = find_twins(faces, int(faces.max()) + 1)
        return cls(faces, twin, lengths)

    @property
    def face_count(self) -> int:
        return len(self.faces)

    def patches(self, patch_size: int) -> NDArray[np.int32]:
        """F x K int32 of face + 1; see `grow_patches`."""
        return grow_patches(sort_adjacency(self.twin, self.lengths), patch_size)

    def pool(
        self, features: NDArray, target: int, options: TopologyOptions = DEFAULT_OPTIONS
    ) -> tuple["Surface", NDArray[np.int32], NDArray[np.float64]]:
        """Collapse to `target` faces by the features (F x C) that equation 5 compares.

        Returns the pooled surface, its index, F' x W int32 of face + 1, and the shares, F' x W
        float64, of the gathered faces; see `pool_faces`.
        """
        kept, faces, twin, index, shares = pool_faces(
            self.faces, self.twin, features, target, options.squared_norm, options.literal
        )
        lengths = self.lengths.reshape(-1, 3).take(kept, axis=0).reshape(-1)
        return Surface(faces, twin, lengths), index, shares


@dataclass(frozen=True, eq=False)
class Topology:
    """The indices of every level of one mesh.

    patches: L arrays, F_l x K int32. pools: L arrays, F_(l+1) x W_l int32, from level l to
    level l + 1. Entries are face + 1 within their level; 0 is the null face. A row of a pool may
    name a face more than once: it counts as often.
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
    """All levels under geometric pooling, where the features of equation 5 are known beforehand.

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
