"""The network's hyper-parameters, each with its reason."""

import json
from dataclasses import asdict, dataclass
from typing import Any


@dataclass(frozen=True)
class NetworkConfig:
    """Everything that shapes the network and the topology it reads.

    Raises ValueError for values that no network can have.
    """

    classes: tuple[str, ...]
    """Names of the N_c classes, in the order of the scores."""
    face_budget: int = 500
    """Faces of a prepared mesh: all three data sets of the paper have 500."""
    patch_size: int = 10
    """K, the face itself included; the authors' setting."""
    channels: tuple[int, ...] = (64, 128, 256)
    """Output channels of each block. The paper leaves them open; its authors' later work uses
    these."""
    convolutions: int = 1
    """Convolutions in each block, all before its pooling."""
    targets: tuple[int, ...] = (400, 300, 200)
    """T, the faces left after each block's pooling (paper, section IV)."""
    descriptor_hidden: int = 128
    descriptor_channels: int = 64
    """Widths of the two layers of each descriptor; ExMeshCNN's, from which they come."""
    absolute_offsets: bool = False
    """Take sum |v_i - c| for equation 1's first term, which as written is zero everywhere."""
    pooling: str = "geometric"
    """Which features weigh the faces in equation 5: the fixed ones of the input."""

    def __post_init__(self) -> None:
        problems = [
            *([] if self.classes else ["classes is empty"]),
            *([] if len(set(self.classes)) == len(self.classes) else ["class names repeat"]),
            *([] if len(self.channels) == len(self.targets) > 0
              else ["channels and targets need one entry for each block"]),
            *([] if min((self.face_budget, self.patch_size, self.convolutions,
                         self.descriptor_hidden, self.descriptor_channels,
                         *self.channels, *self.targets), default=0) >= 1
              else ["every size must be at least 1"]),
            *([] if self.pooling == "geometric" else [f"unknown pooling {self.pooling!r}"]),
        ]
        if problems:
            raise ValueError("invalid network configuration: " + "; ".join(problems))

    @property
    def levels(self) -> int:
        return len(self.targets)

    def to_json(self) -> str:
        return json.dumps(asdict(self))

    @classmethod
    def from_json(cls, text: str) -> "NetworkConfig":
        """Raises ValueError for anything that `to_json` did not write."""
        values: dict[str, Any] = json.loads(text)
        try:
            return cls(**{k: tuple(v) if isinstance(v, list) else v for k, v in values.items()})
        except TypeError as error:
            raise ValueError(f"not a network configuration: {error}") from None


# Named networks; what differs from the defaults above.
PRESETS: dict[str, dict[str, Any]] = {
    "paper": {},
    "deep": {"convolutions": 2},
    "small": {"channels": (32, 64, 128)},
}


def preset(name: str, classes: tuple[str, ...]) -> NetworkConfig:
    """The named network over these classes. Raises ValueError for an unknown name."""
    if name not in PRESETS:
        raise ValueError(f"unknown preset {name!r}; there are {', '.join(PRESETS)}")
    return NetworkConfig(classes=classes, **PRESETS[name])
