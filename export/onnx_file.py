"""Write a checkpoint as one ONNX file that carries its own card."""

import copy
import hashlib
import logging
import warnings
from ast import literal_eval
from collections import Counter
from collections.abc import Mapping, Sequence
from itertools import pairwise
from pathlib import Path

import onnx
import torch
from torch import nn
from torch.export import Dim
from torch.nn.utils.fusion import fuse_linear_bn_eval

from meshconv3d.export.comparison import OUTPUTS
from meshconv3d.export.metadata import ModelCard, Probe
from meshconv3d.export.parity import check_parity, run_network
from meshconv3d.export.translation import TRANSLATIONS
from meshconv3d.export.whole import make_whole
from meshconv3d.model.config import NetworkConfig
from meshconv3d.model.files import write_whole
from meshconv3d.model.mesh import Mesh
from meshconv3d.model.nn.checkpoint import Checkpoint
from meshconv3d.model.nn.layers import Descriptor, PatchConvolution
from meshconv3d.model.nn.network import Network, as_tensors
from meshconv3d.model.topology.inputs import MeshInputs, collate, input_names, mesh_inputs

OPSET = 20

# What the file says of itself, for viewers of graphs. docs/onnx-file.md has all of it.
ABOUT = (
    "MeshConv3D: from the descriptor terms and the indices of prepared meshes to scores. Entries "
    "of indices are row + 1 in the table that they gather from; 0 is a row of zeros. "
    "docs/onnx-file.md says how to compute the inputs."
)
ABOUT_VALUES = {
    "terms": "geometric terms of each face, the input of the learned descriptors",
    "patches": "the K faces of each patch: the face itself, its neighbours, theirs, ...",
    "pools": "the faces that each pooled face gathers",
    "readout": "the faces of each mesh at the last level",
    "scores": "a score for each class; their softmax, over the temperature of the card, is the "
    "probability among the classes",
    "evidence": "what each face of the last level adds to each score",
    "novelty": "how unlike all classes the mesh is: a relative Mahalanobis distance",
    "embedding": "a vector of unit length, near to those of like shapes",
}


def export_model(
    checkpoint: Checkpoint,
    path: Path,
    name: str,
    meshes: Mapping[str, Mesh],
    about: str = "",
    whole: bool = False,
) -> ModelCard:
    """Write a checkpoint to `path`, if the file computes what the network does.

    meshes: at least two that are prepared, by name; the first is a sample, whose scores go into the
    card. The graph is traced on them and compared with torch on each, alone and in one batch.
    about: Markdown for the card. whole: as a whole pipeline; with learned pooling it is one in any
    case, since indices are found between the layers. Raises ParityError, leaving no file.
    """
    network, config = checkpoint.network, checkpoint.network.config
    inputs = {title: mesh_inputs(mesh, config) for title, mesh in meshes.items()}
    graph = trace_graph(network, list(inputs.values()))
    if whole or config.pooling == "learned":
        graph = make_whole(graph, config, meshes)
    training = dict(checkpoint.training)
    card = ModelCard(
        name=name,
        config=config,
        opset=OPSET,
        training=training,
        accuracy=training.pop("accuracy", {}),
        calibration=checkpoint.calibration,
        space=embedding_space(network),
        parity=check_parity(graph.SerializeToString(), network, meshes),
        probe=probe(network, *next(iter(inputs.items()))),
        about=about,
    )
    onnx.helper.set_model_props(graph, card.to_properties())
    write_whole(path, graph.SerializeToString())
    return card


def embedding_space(network: Network) -> str:
    """Hash, 16 hexadecimal digits, of the weights that embeddings depend on."""
    digest = hashlib.sha256()
    for name, tensor in sorted(network.state_dict().items()):
        if not name.startswith(("classify.", "novelty.")):
            digest.update(tensor.numpy().tobytes())
    return digest.hexdigest()[:16]


def probe(network: Network, sample: str, inputs: MeshInputs) -> Probe:
    """A sample mesh with its scores, for the self test of a runtime."""
    scores = run_network(network, collate([inputs]))["scores"]
    return Probe(sample, tuple(round(score, 5) for score in scores[0].tolist()))


def trace_graph(network: Network, meshes: Sequence[MeshInputs]) -> onnx.ModelProto:
    """The folded network as an ONNX graph with symbolic face, batch and pooling-width axes."""
    with warnings.catch_warnings():
        # The exporter warns of deprecations and opset conversions; the parity check decides whether
        # the file is right.
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
    model = program.model_proto
    _describe(model.graph)
    return model


def _describe(graph: onnx.GraphProto) -> None:
    """Name the nodes by their layers, and say what inputs and outputs are."""
    graph.name, graph.doc_string = "meshconv3d", ABOUT
    for value in (*graph.input, *graph.output):
        value.doc_string = ABOUT_VALUES.get(value.name.rstrip("_0123456789"), "")
    numbers = Counter()
    for node in graph.node:
        scopes = [p.value for p in node.metadata_props if p.key == "pkg.torch.onnx.name_scopes"]
        modules = literal_eval(scopes[0])[:-1] if scopes else []
        path = modules[-1] if modules and not modules[0] else ""
        title = f"{path}/{node.op_type}" if path else node.op_type
        numbers[title] += 1
        node.name = f"{title}_{numbers[title]}"
        # Paths of the exporting machine.
        node.ClearField("metadata_props")
        node.ClearField("doc_string")


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


def _dynamic_shapes(config: NetworkConfig) -> tuple:
    """Symbolic axes of each input; K is fixed."""
    if config.pooling == "learned":
        count = Dim("faces_0")
        return {0: count}, ({0: count}, {0: 3 * count}, {0: Dim("batch_and_end")})
    faces = [Dim(f"faces_{level}") for level in range(config.levels + 1)]
    patches = [{0: faces[level]} for level in range(config.levels)]
    pools = [{0: faces[level + 1], 1: Dim(f"pool_width_{level}")} for level in range(config.levels)]
    readout = {0: Dim("batch"), 1: Dim("readout_width")}
    return {0: faces[0]}, (*patches, *pools, readout)
