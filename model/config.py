"""Hyper-parameters of the network, each with its reason."""

import json
from collections.abc import Mapping
from dataclasses import fields
from difflib import get_close_matches
from types import MappingProxyType
from typing import Annotated, Any, Literal, NamedTuple

from pydantic import (
    ConfigDict,
    Field,
    ValidationError,
    model_validator,
)
from pydantic.dataclasses import dataclass

from meshconv3d.model.topology import TopologyOptions

Size = Annotated[int, Field(ge=1, le=2**20)]
Sizes = Annotated[tuple[Size, ...], Field(min_length=1)]


@dataclass(frozen=True, config=ConfigDict(extra="forbid", use_attribute_docstrings=True))
class NetworkConfig:
    """Settings of the network and of the topology that it takes as input.

    Raises pydantic's ValidationError, a ValueError, for values that no network can have.
    """

    classes: Annotated[tuple[str, ...], Field(min_length=1)]
    """Names of the N_c classes, in the order of the scores."""
    face_budget: Size = 500
    """Faces of a prepared mesh: all three data sets of the paper have 500."""
    patch_size: Size = 10
    """K, the face itself included; the authors' setting."""
    patch_reduction: Literal["mean", "sum"] = "mean"
    """How equation 4 gathers a patch."""
    channels: Sizes = (64, 128, 256)
    """Output channels of each block. The paper leaves them open; its authors' later work uses
    these."""
    convolutions: Size = 1
    """Convolutions in each block, all before its pooling."""
    targets: Sizes = (400, 300, 200)
    """T, the faces left after each block's pooling (paper, section IV)."""
    descriptor_hidden: Size = 128
    """Width of the first layer of each descriptor; that of ExMeshCNN, from which they come."""
    descriptor_channels: Size = 64
    """Width of the second layer of each descriptor."""
    axes: Literal["face", "file"] = "face"
    """Axes of the descriptors' 3-vectors: each face's own, which turn with it, or those of the
    mesh's file."""
    absolute_offsets: bool = False
    """Take sum |v_i - c| for equation 1's first term, which as written is zero everywhere."""
    integral_invariants: bool = False
    """Add a third descriptor, of the surface around each face, across gaps; see
    `model.topology.integral_invariants`."""
    pooling: Literal["geometric", "learned"] = "geometric"
    """Features that equation 5 compares: the fixed ones of the input, or those that enter the
    pooling."""
    pooling_norm: Literal["squared", "plain"] = "squared"
    """Norm of the feature differences in equation 5."""
    literal_pooling: bool = False
    """Follow section III.C to the letter at borders and in the pooled average, see `pool_faces`;
    needs learned pooling."""
    readout: Literal["mean", "mean-peak"] = "mean"
    """Input of the classifier: the mean of the last level's features over the faces, or beside it
    a mean close to the maximum of each channel, see `weight_peaks`."""
    dropout: Annotated[float, Field(ge=0, lt=1)] = 0.0
    """Share of the classifier's inputs that training sets to zero at random."""

    @model_validator(mode="after")
    def _check(self) -> "NetworkConfig":
        if len(set(self.classes)) < len(self.classes):
            raise ValueError("class names repeat")
        if len(self.channels) != len(self.targets):
            raise ValueError("channels and targets need one entry for each block")
        if self.literal_pooling and self.pooling != "learned":
            raise ValueError("literal_pooling needs pooling=learned")
        return self

    @property
    def levels(self) -> int:
        return len(self.targets)

    @property
    def topology_options(self) -> TopologyOptions:
        """The settings of pooling."""
        return TopologyOptions(self.pooling_norm == "squared", self.literal_pooling)


# Presets: differences from the defaults above.
PRESETS: dict[str, dict[str, Any]] = {
    "default": {},
    "objects": {
        "absolute_offsets": True,
        "integral_invariants": True,
        "readout": "mean-peak",
        "dropout": 0.3,
    },
    # The paper to the letter, with sums over the K = 10 other faces.
    "paper": {
        "axes": "file",
        "patch_size": 11,
        "patch_reduction": "sum",
        "pooling": "learned",
        "literal_pooling": True,
    },
}


class Setting(NamedTuple):
    """A setting of the network. presets: its value in each preset, as `--set` takes it."""

    name: str
    presets: dict[str, str]
    about: str


def list_settings() -> list[Setting]:
    """All settings of the network but the classes, which are those of the data."""
    configs = {name: preset(name, ("",)) for name in PRESETS}
    described = NetworkConfig.__pydantic_fields__
    return [
        Setting(
            name,
            {title: _text(getattr(config, name)) for title, config in configs.items()},
            " ".join((field.description or "").split()),
        )
        for name, field in described.items()
        if name != "classes"
    ]


def _text(value: object) -> str:
    return value if isinstance(value, str) else json.dumps(value)


def preset(
    name: str, classes: tuple[str, ...], settings: Mapping[str, Any] = MappingProxyType({})
) -> NetworkConfig:
    """Configuration of a preset over these classes. settings: changes to it, by field name.

    Raises ValueError for an unknown name, and for settings that no network can have.
    """
    if name not in PRESETS:
        raise ValueError(f"unknown preset {name!r}; there are {', '.join(PRESETS)}")
    if "classes" in settings:
        raise ValueError("classes: they are those of the data")
    known = [field.name for field in fields(NetworkConfig)]
    for setting in settings:
        if setting not in known:
            near = get_close_matches(setting, known, n=1, cutoff=0)
            raise ValueError(
                f"there is no setting {setting!r}; did you mean {near[0]!r}? "
                f"There are {', '.join(known[1:])}"
            )
    try:
        return NetworkConfig(**{**PRESETS[name], **settings, "classes": classes})
    except ValidationError as error:
        raise ValueError(in_one_line(error)) from None


def in_one_line(error: ValidationError) -> str:
    """Field and message of each mistake, for the messages of other errors."""
    mistakes = []
    for found in error.errors():
        place = ".".join(map(str, found["loc"]))
        message = found["msg"].removeprefix("Value error, ")
        mistakes.append(f"{place}: {message}" if place else message)
    return "; ".join(mistakes)
