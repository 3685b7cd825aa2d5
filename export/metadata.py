"""Card of a model file: the file's metadata, JSON values whose names have one prefix.

Reading it needs neither torch nor onnx.
"""

import json
from collections.abc import Mapping
from typing import Any, Literal

from pydantic import ConfigDict, TypeAdapter, ValidationError, model_validator
from pydantic.dataclasses import dataclass

from meshconv3d.model.calibration import Calibration
from meshconv3d.model.config import NetworkConfig, in_one_line
from meshconv3d.model.errors import Error

PREFIX = "meshconv3d."
FORMAT_VERSION: Literal[6] = 6
NORMALISATION = "surface centroid at the origin, farthest vertex on the unit sphere, float32"


class ModelFileError(Error):
    """Error of a file that is no model of this project, damaged, or made by a newer version."""


@dataclass(frozen=True, config=ConfigDict(extra="forbid"))
class Probe:
    """Name of a sample mesh, and its scores (N_c) in torch."""

    sample: str
    scores: tuple[float, ...]


@dataclass(frozen=True, config=ConfigDict(extra="forbid"))
class ModelCard:
    """Content of a model file except the graph.

    config: settings of the network, with the classes. opset: version of the graph's operators.
    training: data, protocol and seed. accuracy: figures with their protocol. parity: largest
    relative difference to torch of each output, number of meshes, tolerance, versions. calibration:
    None if it was trained without validation meshes. space: names the space of its embeddings; a
    model and those that were taught on it have one. probe: for the self test of a runtime. about:
    description in Markdown.
    """

    name: str
    config: NetworkConfig
    opset: int
    training: dict[str, Any]
    accuracy: dict[str, Any]
    parity: dict[str, Any]
    calibration: Calibration | None
    space: str
    probe: Probe
    about: str
    format_version: Literal[6] = FORMAT_VERSION

    @model_validator(mode="after")
    def _check(self) -> "ModelCard":
        if len(self.probe.scores) != len(self.config.classes):
            raise ValueError("the probe must have one score for each class")
        return self

    @property
    def preparation(self) -> dict[str, Any]:
        """Face budget and normalisation of meshes, which readers compare with their own."""
        return {"face_budget": self.config.face_budget, "normalisation": NORMALISATION}

    def to_dict(self) -> dict[str, Any]:
        """The card as JSON values."""
        return TypeAdapter(ModelCard).dump_python(self, mode="json") | {
            "preparation": self.preparation
        }

    def to_properties(self) -> dict[str, str]:
        """The card as `metadata_props` of an ONNX file."""
        return {PREFIX + name: json.dumps(value) for name, value in self.to_dict().items()}


def read_card(properties: Mapping[str, str]) -> ModelCard:
    """Card from the properties of an ONNX file. Raises ModelFileError, saying what is wrong."""
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
        version = values["format_version"]
        if isinstance(version, int) and version != FORMAT_VERSION:
            # Checked first: another version's metadata may look damaged to this one.
            newer = version > FORMAT_VERSION
            remedy = "upgrade meshconv3d" if newer else "train and export the model again"
            raise ModelFileError(
                f"the model file has format {version}, this version reads format "
                f"{FORMAT_VERSION}: {remedy}"
            )
        preparation = values.pop("preparation", "missing: preparation")
        card = TypeAdapter(ModelCard).validate_python(values)
        TypeAdapter(ModelCard).dump_json(card)  # raises for values that JSON lacks
    except ModelFileError:
        raise
    except ValidationError as error:
        problems = in_one_line(error)
        raise ModelFileError(f"the model file's metadata is damaged: {problems}") from None
    except (ValueError, RecursionError) as error:
        raise ModelFileError(f"the model file's metadata is damaged: {error}") from None
    if preparation != card.preparation:
        raise ModelFileError(
            f"the model needs meshes prepared as {preparation}, this version prepares them as "
            f"{card.preparation}: use the version that exported it, or export it again"
        )
    return card
