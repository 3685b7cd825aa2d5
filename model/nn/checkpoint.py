"""Checkpoints: weights as safetensors, with the configuration in their metadata. No pickle."""

from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import torch
from pydantic import BaseModel, Json, ValidationError
from safetensors import SafetensorError, safe_open
from safetensors.torch import save

from meshconv3d.model.calibration import Calibration
from meshconv3d.model.config import NetworkConfig, in_one_line
from meshconv3d.model.files import write_whole
from meshconv3d.model.nn.network import Network

FORMAT_VERSION = 6


class CheckpointError(ValueError):
    """A file that is not a checkpoint of this project, is damaged, or has another format."""


@dataclass(frozen=True)
class Checkpoint:
    """A network, its calibration, and the record of its training: data, protocol, accuracy.

    calibration: None if it was trained without validation meshes.
    """

    network: Network
    calibration: Calibration | None = None
    training: dict[str, Any] = field(default_factory=dict)


class _Metadata(BaseModel):
    format_version: int
    config: Json[NetworkConfig]
    calibration: Json[Calibration | None]
    training: Json[dict[str, Any]]


def save_checkpoint(checkpoint: Checkpoint, path: Path) -> None:
    """Write atomically, see `write_whole`. Raises OSError."""
    metadata = _Metadata.model_construct(
        format_version=FORMAT_VERSION,
        config=checkpoint.network.config,
        calibration=checkpoint.calibration,
        training=checkpoint.training,
    ).model_dump(mode="json", round_trip=True)
    save_tensors(checkpoint.network.state_dict(), {k: str(v) for k, v in metadata.items()}, path)


def load_checkpoint(path: Path) -> Checkpoint:
    """The network, in evaluation mode, on the CPU. Raises CheckpointError, FileNotFoundError."""
    tensors, entries = load_tensors(path)
    version = entries.get("format_version", "")
    if version.isdecimal() and int(version) != FORMAT_VERSION:
        # Checked first: another version's metadata may look damaged to this one.
        remedy = "upgrade meshconv3d" if int(version) > FORMAT_VERSION else "train it again"
        raise CheckpointError(
            f"{path} has checkpoint format {version}, this version reads format "
            f"{FORMAT_VERSION}: {remedy}"
        )
    try:
        metadata = _Metadata.model_validate(entries)
        network = Network(metadata.config)
        network.novelty.make_room(len(tensors.get("novelty.others", ())))
        network.load_state_dict(tensors)
        if not all(tensor.isfinite().all() for tensor in tensors.values()):
            raise ValueError("its weights are not all finite numbers; train it again")
    except (ValueError, RuntimeError) as error:
        reason = in_one_line(error) if isinstance(error, ValidationError) else error
        raise CheckpointError(
            f"{path} is not a meshconv3d checkpoint, such as training writes as model.safetensors: "
            f"{reason}"
        ) from None
    return Checkpoint(network.eval(), metadata.calibration, metadata.training)


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
