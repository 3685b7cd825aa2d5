"""Does a model file compute what the network computes? On real meshes, alone and together."""

from collections.abc import Sequence

import numpy as np
import torch

from export.metadata import ModelFileError
from export.runtime import onnxruntime as ort
from export.runtime import open_session
from model.inputs import MeshInputs, collate, input_names
from model.network import Network, as_tensors

TOLERANCE = 1e-4
OUTPUTS = ("scores", "evidence")


class ParityError(RuntimeError):
    """The file and the network differ by more than the tolerance, or in shape."""


def check_parity(
    model: bytes, network: Network, meshes: Sequence[MeshInputs]
) -> dict[str, float | int | str]:
    """Run every mesh alone, and all in one ragged batch, under onnxruntime and torch.

    Returns the largest difference of each output, relative to the largest value of that output
    in torch, and what it was measured on. Raises ParityError listing every failure.
    """
    session = _open(model, network)
    worst = dict.fromkeys(OUTPUTS, 0.0)
    failures = []
    batches = {f"mesh {i}": [mesh] for i, mesh in enumerate(meshes)}
    batches[f"ragged batch of {len(meshes)}"] = list(meshes)
    for title, batch in batches.items():
        arrays = collate(batch)
        with torch.inference_mode():
            expected = network.eval()(*as_tensors(arrays))
        for name, ours, theirs in zip(OUTPUTS, session.run(None, arrays), expected, strict=True):
            difference = relative_difference(np.asarray(ours), theirs.numpy())
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
    """The file, which must take and give by name what the network does. Raises ParityError."""
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


def relative_difference(ours: np.ndarray, theirs: np.ndarray) -> float:
    """Largest absolute difference over the largest absolute value; infinite across shapes."""
    if ours.shape != theirs.shape:
        return float("inf")
    return float(np.abs(ours - theirs).max() / max(np.abs(theirs).max(), 1e-12))
