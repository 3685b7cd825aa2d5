"""Ragged batches: the faces of several meshes one after the other.

`starts`, B + 1 int32: mesh i has the faces starts[i] to starts[i + 1] - 1 of the batch.

Learned pooling computes the topology between the layers of the network: the torch operators of
`model.nn.levels` call `grow_patches` and `pool_faces`. They take arrays, and integers as
attributes, as ONNX has them.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import accumulate, pairwise

import numpy as np
from numpy.typing import NDArray

from meshconv3d.model.topology.surface import Surface, TopologyOptions


@dataclass(frozen=True, eq=False)
class SurfaceBatch:
    """The surfaces of a batch at one pooling level, as one surface of many components.

    joint: no two meshes have a vertex in common. starts: B + 1 int32.
    """

    joint: Surface
    starts: NDArray[np.int32]

    @classmethod
    def of(cls, surfaces: Sequence[Surface]) -> "SurfaceBatch":
        """The surfaces, joined in their order."""
        starts = np.cumsum([0, *(surface.face_count for surface in surfaces)], dtype=np.int32)
        corners = accumulate((int(s.faces.max()) + 1 for s in surfaces), initial=0)
        faces = [s.faces + np.int32(first) for s, first in zip(surfaces, corners, strict=False)]
        lengths = np.concatenate([surface.lengths for surface in surfaces])
        return cls(Surface.over(np.concatenate(faces), lengths), starts)

    def surfaces(self) -> list[Surface]:
        """The surface of each mesh by itself."""
        pieces = []
        for start, end in pairwise(self.starts):
            faces = self.joint.faces[start:end]
            lengths = self.joint.lengths[3 * start : 3 * end]
            pieces.append(Surface.over(faces - faces.min(), lengths))
        return pieces

    def pool(
        self, features: NDArray, target: int, options: TopologyOptions
    ) -> tuple["SurfaceBatch", NDArray[np.int32], NDArray[np.float32]]:
        """Collapse every mesh to `target` faces by the features (N x C) that equation 5 compares.

        Returns the pooled batch, its index into the rows of this one, N' x W int32, and the share
        of each gathered face in the pooled one, N' x W float32.
        """
        pooled, indices, shares = zip(
            *(
                surface.pool(features[start:end], target, options)
                for surface, (start, end) in zip(
                    self.surfaces(), pairwise(self.starts), strict=True
                )
            ),
            strict=True,
        )
        index = join_indices(indices, self.starts[:-1])
        joined = np.zeros(index.shape, np.float32)
        joined[index > 0] = np.concatenate([part[part > 0] for part in shares])
        return SurfaceBatch.of(pooled), index, joined


def join_indices(
    indices: Sequence[NDArray[np.int32]], starts: Sequence[int] | NDArray
) -> NDArray[np.int32]:
    """Concatenate null-padded indices of any widths over tables that begin at `starts`."""
    if len(indices) == 1:
        return indices[0]
    width = max(index.shape[1] for index in indices)
    joined = np.zeros((sum(map(len, indices)), width), np.int32)
    row = 0
    for index, start in zip(indices, starts, strict=True):
        block = joined[row : row + len(index), : index.shape[1]]
        np.add(index, np.int32(start), out=block, where=index > 0)
        row += len(index)
    return joined


def grow_patches(
    faces: NDArray[np.int32], lengths: NDArray[np.float64], *, patch_size: int
) -> NDArray[np.int32]:
    """Patches of every face of a batch, N x K int32 of face + 1.

    faces, N x 3; lengths, 3 N: see `Surface`; no two meshes of the batch have a vertex in common.
    """
    return Surface.over(faces, lengths).patches(patch_size)


def pool_faces(
    features: NDArray[np.float32],
    faces: NDArray[np.int32],
    lengths: NDArray[np.float64],
    starts: NDArray[np.int32],
    *,
    target: int,
    squared_norm: int,
    literal: int,
) -> tuple[
    NDArray[np.int32],
    NDArray[np.float32],
    NDArray[np.int32],
    NDArray[np.float64],
    NDArray[np.int32],
]:
    """Collapse every mesh of a batch to `target` faces by features, N x C.

    starts: B + 1, where each mesh's faces begin. Returns (index, shares, faces, lengths, starts):
    the pooling index, N' x W int32 of face + 1; the share of each gathered face in the pooled
    one, N' x W float32; and the pooled batch.
    """
    options = TopologyOptions(squared_norm=bool(squared_norm), literal=bool(literal))
    batch = SurfaceBatch(Surface.over(faces, lengths), starts)
    pooled, index, shares = batch.pool(features, target, options)
    return index, shares, pooled.joint.faces, pooled.joint.lengths, pooled.starts
