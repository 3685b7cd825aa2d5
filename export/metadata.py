"""What a model file says of itself: its card, as JSON values under one prefix.

A runtime needs the file and nothing else. Reading the card needs neither torch nor onnx.
"""

import json
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

from model.config import NetworkConfig

PREFIX = "meshconv3d."
FORMAT_VERSION = 1
NORMALISATION = "surface centroid at the origin, farthest vertex on the unit sphere"


class ModelFileError(ValueError):
    """A file that is no model of this project, is damaged, or was made by a newer version."""


@dataclass(frozen=True)
class ModelCard:
    """Everything in a model file that is not the graph.

    config: the network, its topology and its classes. preparation: what a mesh must go through
    first. opset: of the graph. training: data, protocol and seed. accuracy: figures with their
    protocol. parity: largest relative difference to torch of each output, and on what.
    probe: a sample mesh by name and its scores; whoever runs the model can test it with that.
    """

    name: str
    config: NetworkConfig
    opset: int
    training: dict[str, Any] = field(default_factory=dict)
    accuracy: dict[str, Any] = field(default_factory=dict)
    parity: dict[str, Any] = field(default_factory=dict)
    probe: dict[str, Any] = field(default_factory=dict)
    format_version: int = FORMAT_VERSION

    @property
    def preparation(self) -> dict[str, Any]:
        return {"face_budget": self.config.face_budget, "normalisation": NORMALISATION}

    def to_properties(self) -> dict[str, str]:
        """The card as `metadata_props` of an ONNX file."""
        return {PREFIX + name: json.dumps(value) for name, value in self.to_dict().items()}

    def to_dict(self) -> dict[str, Any]:
        """The card as plain values, for people and programs."""
        return {
            "format_version": self.format_version,
            "name": self.name,
            "config": json.loads(self.config.to_json()),
            "preparation": self.preparation,
            "opset": self.opset,
            "training": self.training,
            "accuracy": self.accuracy,
            "parity": self.parity,
            "probe": self.probe,
        }


def read_card(properties: Mapping[str, str]) -> ModelCard:
    """The card from an ONNX file's properties. Raises ModelFileError, saying what is wrong."""
    if PREFIX + "format_version" not in properties:
        raise ModelFileError(
            "the file is an ONNX model, but not one of meshconv3d (its metadata has no "
            f"{PREFIX}format_version); make one with: meshconv3d export CHECKPOINT -o MODEL.onnx"
        )
    try:
        values = {
            name.removeprefix(PREFIX): json.loads(value)
            for name, value in properties.items()
            if name.startswith(PREFIX)
        }
        version = int(values["format_version"])
        if version > FORMAT_VERSION:
            raise ModelFileError(
                f"the model file has format {version}, this version reads up to "
                f"{FORMAT_VERSION}: upgrade meshconv3d"
            )
        card = ModelCard(
            name=str(values["name"]),
            config=NetworkConfig.from_json(json.dumps(values["config"])),
            opset=int(values["opset"]),
            training=dict(values["training"]),
            accuracy=dict(values["accuracy"]),
            parity=dict(values["parity"]),
            probe=dict(values["probe"]),
            format_version=version,
        )
        preparation = values["preparation"]
    except ModelFileError:
        raise
    except (KeyError, TypeError, ValueError) as error:
        raise ModelFileError(f"the model file's metadata is damaged: {error!r}") from None
    if preparation != card.preparation:
        raise ModelFileError(
            f"the model wants meshes prepared as {preparation}, "
            f"this version prepares them as {card.preparation}"
        )
    return card
