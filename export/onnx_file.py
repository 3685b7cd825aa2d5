"""Write a checkpoint as one ONNX file that carries its own card."""

import logging
import warnings
from collections.abc import Mapping, Sequence
from pathlib import Path

import onnx
import torch
from torch.export import Dim

from meshconv3d.export.graph import fold_batch_norm
from meshconv3d.export.metadata import ModelCard, Probe
from meshconv3d.export.parity import OUTPUTS, check_parity
from meshconv3d.export.translation import TRANSLATIONS
from meshconv3d.model.config import NetworkConfig
from meshconv3d.model.files import write_whole
from meshconv3d.model.nn.checkpoint import Checkpoint
from meshconv3d.model.nn.network import Network, as_tensors
from meshconv3d.model.topology.inputs import MeshInputs, collate, input_names

OPSET = 20


def export_model(
    checkpoint: Checkpoint,
    path: Path,
    name: str,
    meshes: Mapping[str, MeshInputs],
    about: str = "",
) -> ModelCard:
    """Export to `path` and return the card; the file appears only once it has proved itself.

    meshes: at least two, by name, the first a sample, whose scores go into the card. The graph
    is traced on them and compared with torch on each, alone and in one batch. about: Markdown for
    the card. Raises ParityError, leaving no file.
    """
    graph = trace_graph(checkpoint.network, list(meshes.values()))
    training = dict(checkpoint.training)
    card = ModelCard(
        name=name,
        config=checkpoint.network.config,
        opset=OPSET,
        training=training,
        accuracy=training.pop("accuracy", {}),
        calibration=checkpoint.calibration,
        parity=check_parity(graph.SerializeToString(), checkpoint.network, list(meshes.values())),
        probe=probe(checkpoint.network, *next(iter(meshes.items()))),
        about=about,
    )
    onnx.helper.set_model_props(graph, card.to_properties())
    write_whole(path, graph.SerializeToString())
    return card


def probe(network: Network, sample: str, inputs: MeshInputs) -> Probe:
    """A sample mesh with its scores, by which a runtime can test itself."""
    with torch.inference_mode():
        scores = network.eval()(*as_tensors(collate([inputs]))).scores
    return Probe(sample, tuple(round(score, 5) for score in scores[0].tolist()))


def trace_graph(network: Network, meshes: Sequence[MeshInputs]) -> onnx.ModelProto:
    """The folded network as an ONNX graph with symbolic face, batch and pooling-width axes."""
    with warnings.catch_warnings():
        # The exporter warns of matters of its own (deprecations, opset conversions); parity
        # decides whether the file is right.
        warnings.simplefilter("ignore")
        for name in ("torch.onnx", "torch.fx"):
            logging.getLogger(name).setLevel(logging.ERROR)
        program = torch.onnx.export(
            fold_batch_norm(network),
            as_tensors(collate(meshes)),
            dynamo=True,
            verbose=False,
            opset_version=OPSET,
            input_names=input_names(network.config),
            output_names=list(OUTPUTS),
            dynamic_shapes=_dynamic_shapes(network.config),
            custom_translation_table=TRANSLATIONS,
        )
    assert program is not None
    graph = program.model_proto
    # Traces of where the code lay on the exporting machine are of no use to anyone else.
    for node in graph.graph.node:
        node.ClearField("metadata_props")
        node.ClearField("doc_string")
    return graph


def _dynamic_shapes(config: NetworkConfig) -> tuple:
    """Symbolic axes of each input; K is the network's own and stays fixed."""
    if config.pooling == "learned":
        count = Dim("faces_0")
        return {0: count}, ({0: 3 * count}, {0: 3 * count}, {0: Dim("batch_and_end")})
    faces = [Dim(f"faces_{level}") for level in range(config.levels + 1)]
    patches = [{0: faces[level]} for level in range(config.levels)]
    pools = [{0: faces[level + 1], 1: Dim(f"pool_width_{level}")} for level in range(config.levels)]
    readout = {0: Dim("batch"), 1: Dim("readout_width")}
    return {0: faces[0]}, (*patches, *pools, readout)
