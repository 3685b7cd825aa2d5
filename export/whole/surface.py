"""The pooling levels of one mesh: every index by which the network gathers features."""

from typing import NamedTuple

import onnx
from onnx import helper

from meshconv3d.export.whole.arrays import (
    DOUBLE,
    INT,
    REAL,
    Array,
    Graph,
    concatenate,
    constant,
    max_over,
)
from meshconv3d.export.whole.halfedges import find_twins, grow_patches, number_used, sort_adjacency
from meshconv3d.export.whole.pooling import gather_mean, pool_faces
from meshconv3d.model.config import NetworkConfig

# Of the operators that torch's exporter writes for learned pooling, see `write_operators`.
DOMAIN = "meshconv3d"


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
    # Pooling takes memory by the square of the vertices.
    faces, vertex_count = number_used(faces, vertex_count)
    patches, pools = [], []
    squared = config.pooling_norm == "squared"
    for target in config.targets:
        if pools:
            features = gather_mean(features, pools[-1])
        patches.append(grow_patches(sort_adjacency(twin, lengths), config.patch_size))
        pooled = pool_faces(faces, twin, features, vertex_count, target, squared, False)
        faces, twin = pooled.faces, pooled.twin
        lengths = lengths.reshape(-1, 3)[pooled.kept].reshape(-1)
        pools.append(pooled.index)
    return Topology(patches, pools, faces.size())


def write_operators(model: onnx.ModelProto, config: NetworkConfig, prefix: str) -> onnx.ModelProto:
    """The model with standard operators for GrowPatches and PoolFaces, of a batch of one mesh.

    These two compute the levels under learned pooling (`model.topology.batch`). prefix: of the
    names of all values that are added.
    """
    with Graph(prefix) as graph:
        for node in model.graph.node:
            if node.domain != DOMAIN:
                graph.nodes.append(node)
                continue
            outputs = _grow_patches if node.op_type == "GrowPatches" else _pool_faces
            attributes = {a.name: helper.get_attribute_value(a) for a in node.attribute}
            for array, name in zip(outputs(*node.input, **attributes), node.output, strict=True):
                graph.name_output(array, name)
    written = onnx.ModelProto()
    written.CopyFrom(model)
    proto = graph.to_proto(model.graph.name, model.graph.input, model.graph.output)
    proto.initializer.extend(model.graph.initializer)
    written.graph.CopyFrom(proto)
    kept = [entry for entry in model.opset_import if entry.domain != DOMAIN]
    del written.opset_import[:]
    written.opset_import.extend(kept)
    return written


def _grow_patches(faces: str, lengths: str, *, patch_size: int) -> list[Array]:
    _, twin, _ = _surface(faces)
    adjacency = sort_adjacency(twin, Array(lengths, DOUBLE))
    return [grow_patches(adjacency, patch_size).astype("int32")]


def _pool_faces(
    features: str,
    faces: str,
    lengths: str,
    starts: str,
    *,
    target: int,
    squared_norm: int,
    literal: int,
) -> list[Array]:
    corners, twin, count = _surface(faces)
    options = target, bool(squared_norm), bool(literal)
    pooled = pool_faces(corners, twin, Array(features, REAL), count, *options)
    kept = Array(lengths, DOUBLE).reshape(-1, 3)[pooled.kept].reshape(-1)
    ends = concatenate([constant([0]), pooled.faces.size().reshape(1)], 0)
    index, corners, ends = (each.astype("int32") for each in (pooled.index, pooled.faces, ends))
    return [index, pooled.shares.astype(REAL), corners, kept, ends]


def _surface(faces: str) -> tuple[Array, Array, Array]:
    """Corners, twins and the number of vertices."""
    corners = Array(faces, "int32").astype(INT)
    corners, count = number_used(corners, max_over(corners) + 1)
    return corners, find_twins(corners, count), count
