"""Comparison of a model file with its network on real meshes, alone and in a ragged batch."""

from collections.abc import Sequence

import numpy as np
import torch

from meshconv3d.export.metadata import ModelFileError
from meshconv3d.export.runtime import onnxruntime as ort
from meshconv3d.export.runtime import open_session
from meshconv3d.model.nn.network import Network, Outputs, as_tensors
from meshconv3d.model.topology.inputs import MeshInputs, collate, input_names

TOLERANCE = 1e-4
OUTPUTS = Outputs._fields


class ParityError(RuntimeError):
    """The file and the network differ by more than the tolerance, or in shape."""


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
    arrays = {title: collate(batch) for title, batch in batches.items()}
    with torch.inference_mode():
        expected = {title: network.eval()(*as_tensors(array)) for title, array in arrays.items()}
    worst = dict.fromkeys(OUTPUTS, 0.0)
    failures = []
    for title, array in arrays.items():
        for name, ours in zip(OUTPUTS, session.run(OUTPUTS, array), strict=True):
            scale = max(float(getattr(each, name).abs().max()) for each in expected.values())
            theirs = getattr(expected[title], name).numpy()
            difference = relative_difference(np.asarray(ours), theirs, scale)
            worst[name] = max(worst[name], difference)
            if not difference <= TOLERANCE:
                failures.append(f"{title}: {name} differs by {difference:.2e}")
    if failures:
        raise ParityError(
            f"the file does not compute what the checkpoint does (tolerance {TOLERANCE:g}, "
            "relative):\n  " + "\n  ".join(failures)
        )
    return {
        **{name: float(f"{value:.3g}") for name, value in worst.items()},
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


def relative_difference(ours: np.ndarray, theirs: np.ndarray, scale: float) -> float:
    """Largest absolute difference over `scale`; infinite if the shapes differ."""
    if ours.shape != theirs.shape:
        return float("inf")
    return float(np.abs(ours - theirs).max() / max(scale, 1e-12))
