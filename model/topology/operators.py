"""The topology stage as two functions on plain arrays: the kernels of the graph's operators.

Learned pooling needs the topology between the layers of the network. These are what torch
(`model.nn.operators`) and onnxruntime (`export.operators`) call there; a runtime of another kind
can supply its own. Attributes are whole numbers, as ONNX has them.
"""

import numpy as np
from numpy.typing import NDArray

from meshconv3d.model.topology.ragged import SurfaceBatch
from meshconv3d.model.topology.surface import Surface, TopologyOptions


def grow_patches(
    twin: NDArray[np.int32], lengths: NDArray[np.float64], *, patch_size: int
) -> NDArray[np.int32]:
    """Patches of every face of a batch, N x K int32 of face + 1.

    twin, 3 N; lengths, 3 N: see `Surface`; twins count the half-edges of the whole batch.
    """
    return Surface(twin, lengths).patches(patch_size)


def pool_faces(
    features: NDArray[np.float32],
    twin: NDArray[np.int32],
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

    starts: B + 1, where each mesh's faces begin. Returns (index, shares, twin, lengths, starts):
    the pooling index, N' x W int32 of face + 1; the share of each gathered face in the pooled
    one, N' x W float32; and the pooled batch.
    """
    options = TopologyOptions(squared_norm=bool(squared_norm), literal=bool(literal))
    batch = SurfaceBatch(Surface(twin, lengths), starts)
    pooled, index, shares = batch.pool(features, target, options)
    return index, shares, pooled.joint.twin, pooled.joint.lengths, pooled.starts
