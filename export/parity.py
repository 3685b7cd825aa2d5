"""Comparison of a model file with its network on real meshes, alone and in a ragged batch."""

from collections.abc import Sequence

import numpy as np
import torch

from meshconv3d.export.comparison import OUTPUTS, TOLERANCE, ParityError, compare_outputs
from meshconv3d.export.metadata import ModelFileError
from meshconv3d.export.runtime import onnxruntime as ort
from meshconv3d.export.runtime import open_session
from meshconv3d.model.nn.network import Network, as_tensors
from meshconv3d.model.topology.inputs import MeshInputs, collate, input_names


def check_parity(
    model: bytes, network: Network, meshes: Sequence[MeshInputs]
) -> dict[str, float | int | str]:
    """Run every mesh alone, and all in one ragged batch, under onnxruntime and torch.

    Returns the largest difference of each output, relative to the largest value of that output
    for any of the meshes in torch, and what it was measured on. Raises ParityError listing every
    failure.
    """
    session = _open(model, network)
    batches = {f"mesh {i}": [mesh] for i, mesh in enumerate(meshes)}
    batches[f"ragged batch of {len(meshes)}"] = list(meshes)
    found, expected = {}, {}
    for title, batch in batches.items():
        arrays = collate(batch)
        outputs = session.run(OUTPUTS, arrays)
        found[title] = dict(zip(OUTPUTS, map(np.asarray, outputs), strict=True))
        with torch.inference_mode():
            outputs = network.eval()(*as_tensors(arrays))
        expected[title] = {name: getattr(outputs, name).numpy() for name in OUTPUTS}
    return {
        **compare_outputs(found, expected, "the checkpoint"),
        "meshes": len(meshes),
        "tolerance": TOLERANCE,
        "onnxruntime": ort.__version__,
        "torch": torch.__version__,
    }


def _open(model: bytes, network: Network) -> ort.InferenceSession:
    """A session on the file; its inputs and outputs must have the names of the network's."""
    try:
        session = open_session(model)
    except ModelFileError as error:
        raise ParityError(str(error)) from None
    for kind, found, expected in (
        ("inputs", session.get_inputs(), input_names(network.config)),
        ("outputs", session.get_outputs(), list(OUTPUTS)),
    ):
        names = [value.name for value in found]
        if names != expected:
            raise ParityError(f"the file's {kind} are {names}, expected {expected}")
    return session
