"""Checkpoints: weights as safetensors, with the configuration in their metadata. No pickle."""

import json
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import torch
from pydantic import TypeAdapter
from safetensors import SafetensorError, safe_open
from safetensors.torch import save

from meshconv3d.model.calibration import Calibration
from meshconv3d.model.config import NetworkConfig
from meshconv3d.model.files import write_whole
from meshconv3d.model.nn.network import Network

FORMAT_VERSION = 3
OLDEST_VERSION = 2

_CALIBRATION = TypeAdapter(Calibration | None)
_TRAINING = TypeAdapter(dict[str, Any])


class CheckpointError(ValueError):
    """A file that is not a checkpoint of this project, or is damaged, or is of a newer version."""


@dataclass(frozen=True)
class Checkpoint:
    """A network, its calibration, and the record of its training: data, protocol, accuracy.

    calibration: None if it was trained without validation meshes.
    """

    network: Network
    calibration: Calibration | None = None
    training: dict[str, Any] = field(default_factory=dict)


def save_checkpoint(checkpoint: Checkpoint, path: Path) -> None:
    """Write atomically, see `write_whole`. Raises OSError."""
    metadata = {
        "format_version": str(FORMAT_VERSION),
        "config": checkpoint.network.config.to_json(),
        "calibration": _CALIBRATION.dump_json(checkpoint.calibration).decode(),
        "training": json.dumps(checkpoint.training),
    }
    save_tensors(checkpoint.network.state_dict(), metadata, path)


def load_checkpoint(path: Path) -> Checkpoint:
    """The network, in evaluation mode, on the CPU. Raises CheckpointError, FileNotFoundError."""
    tensors, metadata = load_tensors(path)
    try:
        version = int(metadata["format_version"])
        if not OLDEST_VERSION <= version <= FORMAT_VERSION:
            remedy = "upgrade meshconv3d" if version > FORMAT_VERSION else "train it again"
            raise CheckpointError(
                f"{path} has checkpoint format {version}, this version reads {OLDEST_VERSION} to "
                f"{FORMAT_VERSION}: {remedy}"
            )
        network = Network(NetworkConfig.from_json(metadata["config"]))
        network.load_state_dict(
            # The name in format version 2.
            {k.replace("surroundings.", "integral_invariants."): v for k, v in tensors.items()}
        )
        if not all(tensor.isfinite().all() for tensor in tensors.values()):
            raise ValueError("its weights are not all finite numbers; train it again")
        calibration = _CALIBRATION.validate_json(metadata["calibration"])
        training = _TRAINING.validate_json(metadata["training"])
    except CheckpointError:
        raise
    except KeyError as error:
        raise CheckpointError(
            f"{path} is not a meshconv3d checkpoint (its metadata has no {error}); training writes "
            "one as model.safetensors, beside what it resumes from"
        ) from None
    except (ValueError, RuntimeError) as error:
        raise CheckpointError(f"{path} is not a meshconv3d checkpoint: {error}") from None
    return Checkpoint(network.eval(), calibration, training)


def save_tensors(tensors: dict[str, torch.Tensor], metadata: dict[str, str], path: Path) -> None:
    """Write a safetensors file atomically. Raises OSError."""
    write_whole(path, save({k: v.contiguous() for k, v in tensors.items()}, metadata))


def load_tensors(path: Path) -> tuple[dict[str, torch.Tensor], dict[str, str]]:
    """All tensors and the metadata of a safetensors file. Raises CheckpointError."""
    if not path.is_file():
        raise FileNotFoundError(f"no such checkpoint: {path}")
    try:
        with safe_open(path, framework="pt") as file:
            return {name: file.get_tensor(name) for name in file.keys()}, file.metadata() or {}  # noqa: SIM118 (no mapping)
    except SafetensorError as error:
        raise CheckpointError(f"{path} is not a safetensors file: {error}") from None
