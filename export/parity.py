"""Comparison of a model file with its network on real meshes, alone and in a ragged batch."""

from collections.abc import Mapping

import numpy as np
import torch
from numpy.typing import NDArray

from meshconv3d.export.comparison import OUTPUTS, TOLERANCE, ParityError, compare_outputs
from meshconv3d.export.metadata import ModelFileError
from meshconv3d.export.runtime import graph_inputs, is_whole, open_session
from meshconv3d.export.runtime import onnxruntime as ort
from meshconv3d.model.mesh import Mesh
from meshconv3d.model.nn.network import Network, as_tensors
from meshconv3d.model.topology.inputs import collate, input_names, mesh_inputs


def check_parity(
    model: bytes, network: Network, meshes: Mapping[str, Mesh]
) -> dict[str, float | int | str]:
    """Run prepared meshes, by name, under onnxruntime and torch.

    Each runs alone and, but in a whole pipeline, which takes one, all in one ragged batch. Returns
    the largest difference of each output, relative to the largest value of that output for any of
    the meshes in torch, and what it was measured on. Raises ParityError listing every failure.
    """
    session = _open(model, network)
    config = network.config
    inputs = {name: graph_inputs(session, mesh, config) for name, mesh in meshes.items()}
    feeds = {name: each.arrays for name, each in inputs.items()}
    read = {name: [mesh_inputs(each.mesh, config)] for name, each in inputs.items()}
    if not is_whole(session):
        batch = f"ragged batch of {len(meshes)}"
        read[batch] = [inputs for (inputs,) in read.values()]
        feeds[batch] = collate(read[batch])
    found, expected = {}, {}
    for title, feed in feeds.items():
        outputs = session.run(OUTPUTS, feed)
        found[title] = dict(zip(OUTPUTS, map(np.asarray, outputs), strict=True))
        expected[title] = run_network(network, collate(read[title]))
    return {
        **compare_outputs(found, expected, "the checkpoint"),
        "meshes": len(meshes),
        "tolerance": TOLERANCE,
        "onnxruntime": ort.__version__,
        "torch": torch.__version__,
    }


def run_network(network: Network, arrays: Mapping[str, NDArray]) -> dict[str, NDArray]:
    """The outputs of a network, by name, for the arrays of `collate`."""
    with torch.inference_mode():
        outputs = network.eval()(*as_tensors(arrays))
    return {name: getattr(outputs, name).numpy() for name in OUTPUTS}


def _open(model: bytes, network: Network) -> ort.InferenceSession:
    """A session on the file; its inputs and outputs must have the names of the network's."""
    try:
        session = open_session(model)
    except ModelFileError as error:
        raise ParityError(str(error)) from None
    inputs = [value.name for value in session.get_inputs()]
    outputs = [value.name for value in session.get_outputs()]
    if inputs != input_names(network.config) and not is_whole(session):
        raise ParityError(f"the file's inputs are {inputs}, expected {input_names(network.config)}")
    if outputs != list(OUTPUTS):
        raise ParityError(f"the file's outputs are {outputs}, expected {list(OUTPUTS)}")
    return session
