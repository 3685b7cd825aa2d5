"""The topology stage as a graph, and the graph of a model file joined to it."""

import json
from collections.abc import Mapping
from pathlib import Path

import onnx
from onnx import TensorProto, compose, helper

from meshconv3d.export.metadata import PREFIX, ModelCard, read_card
from meshconv3d.export.whole.arrays import (
    DOUBLE,
    INT,
    REAL,
    Array,
    Graph,
    arange,
    concatenate,
    constant,
    expand,
)
from meshconv3d.export.whole.descriptors import descriptor_terms, pooling_features
from meshconv3d.export.whole.geometry import face_geometry
from meshconv3d.export.whole.halfedges import edge_lengths, find_twins
from meshconv3d.export.whole.integral_invariants import integral_invariants
from meshconv3d.export.whole.parity import check_outputs, check_topology
from meshconv3d.export.whole.surface import build_topology, write_operators
from meshconv3d.model.config import NetworkConfig
from meshconv3d.model.files import write_whole
from meshconv3d.model.mesh import Mesh
from meshconv3d.model.topology.inputs import input_names

# Before the names of all values that the topology stage adds.
OWN = "whole."
# What the file says of itself, for viewers of graphs.
ABOUT = (
    "MeshConv3D: from the vertices and faces of one prepared mesh to scores. docs/any-runtime.md "
    "says how to prepare a mesh, and what the outputs are."
)


def export_whole(model: onnx.ModelProto, path: Path, meshes: Mapping[str, Mesh]) -> ModelCard:
    """Write the whole pipeline of a model file, if it computes what that file and the kernels do.

    meshes: prepared, to compare on. Returns the card, which is the model's but for the parity.
    Raises ModelFileError for a file without a card, and ParityError, leaving no file.
    """
    properties = {entry.key: entry.value for entry in model.metadata_props}
    config = read_card(properties).config
    whole = make_whole(model, config, meshes)
    parity = check_outputs(whole.SerializeToString(), model.SerializeToString(), config, meshes)
    properties[PREFIX + "parity"] = json.dumps(parity)
    helper.set_model_props(whole, properties)
    write_whole(path, whole.SerializeToString())
    return read_card(properties)


def make_whole(
    model: onnx.ModelProto, config: NetworkConfig, meshes: Mapping[str, Mesh]
) -> onnx.ModelProto:
    """The whole pipeline of a graph, without a card; its outputs remain to be compared.

    meshes: prepared, on which its topology stage must choose the faces of the kernels. Raises
    ParityError.
    """
    topology = topology_model(config, model)
    check_topology(topology.SerializeToString(), config, meshes)
    return join(topology, model, config)


def join(
    topology: onnx.ModelProto, model: onnx.ModelProto, config: NetworkConfig
) -> onnx.ModelProto:
    """The graph of the topology stage, and that of the network on its outputs; without a card.

    Inputs are vertices, V x 3 float32, and faces, F x 3 int64, of one prepared mesh; outputs are
    those of the network.
    """
    network = write_operators(model, config, f"{OWN}levels.")
    network.ClearField("metadata_props")
    joined = [(OWN + name, name) for name in input_names(config)]
    whole = compose.merge_models(topology, network, joined)
    del whole.opset_import[1:]  # it names those of both
    whole.graph.doc_string = ABOUT
    return whole


def topology_model(config: NetworkConfig, model: onnx.ModelProto) -> onnx.ModelProto:
    """The topology stage alone, for onnxruntimes that open the model.

    Its outputs are the inputs of the network, each named `whole.` and that input's name.
    """
    with Graph(OWN) as graph:
        arrays = network_inputs(Array("vertices", REAL), Array("faces", INT), config)
        for name, array in arrays.items():
            graph.name_output(array, OWN + name)
    inputs = [
        helper.make_tensor_value_info("vertices", TensorProto.FLOAT, ["vertices", 3]),
        helper.make_tensor_value_info("faces", TensorProto.INT64, ["faces", 3]),
    ]
    outputs = [
        helper.make_tensor_value_info(
            OWN + name,
            helper.np_dtype_to_tensor_dtype(array.dtype),
            [None] if name in ("lengths", "starts") else [None, None],
        )
        for name, array in arrays.items()
    ]
    return helper.make_model(
        graph.to_proto("topology", inputs, outputs),
        ir_version=model.ir_version,
        opset_imports=[entry for entry in model.opset_import if not entry.domain],
    )


def network_inputs(vertices: Array, faces: Array, config: NetworkConfig) -> dict[str, Array]:
    """The arrays of `model.topology.inputs.collate`, of one mesh."""
    count = vertices.size()
    vertices = vertices.astype(DOUBLE)
    geometry = face_geometry(vertices, faces)
    twin = find_twins(faces, count)
    terms = descriptor_terms(
        vertices, faces, twin, geometry, config.absolute_offsets, config.axes == "face"
    )
    if config.integral_invariants:
        terms = concatenate([terms, integral_invariants(geometry)], 1)
    lengths = edge_lengths(vertices, faces)
    names = input_names(config)
    if config.pooling == "learned":
        starts = concatenate([constant([0]), faces.size().reshape(1)], 0)
        arrays = [terms, faces.astype("int32"), lengths, starts.astype("int32")]
        return dict(zip(names, arrays, strict=True))
    features = pooling_features(geometry)
    topology = build_topology(faces, twin, lengths, features, count, config)
    readout = expand(arange(topology.last, start=1), 0)
    indices = [*topology.patches, *topology.pools, readout]
    arrays = [terms, *(index.astype("int32") for index in indices)]
    return dict(zip(names, arrays, strict=True))
