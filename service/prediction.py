"""Result types: what one mesh is, or why that is not known.

These values cross the worker border and every function border of the service. JSON, CSV and tables
are made of them at the edge, by `service.records`.
"""

from dataclasses import dataclass
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from meshconv3d.model.errors import MeshError
from meshconv3d.model.preparation import MeshReport


@dataclass(frozen=True)
class ModelId:
    """Name of a model and SHA-256 of its file."""

    name: str
    sha256: str


@dataclass(frozen=True, eq=False)
class Prediction:
    """Class scores of one mesh.

    classes: N_c names, in the order of the scores. scores: N_c float32 logits; probabilities: N_c
    float64, their calibrated softmax. novelty: out-of-distribution score, see
    `model.nn.out_of_distribution`; unknown: whether it exceeds the model's limit, None for a model
    without one. report: what preparation found and did. timings_ms: wall-clock milliseconds of each
    stage: read, prepare, topology, infer, and explain if that was asked for.

    explanation: bytes of a GLB, PLY or JSON file; picture: bytes of a PNG. None if not asked for.
    """

    model: ModelId
    classes: tuple[str, ...]
    scores: NDArray[np.float32]
    probabilities: NDArray[np.float64]
    novelty: float
    unknown: bool | None
    report: MeshReport
    timings_ms: dict[str, float]
    explanation: bytes | None = None
    picture: bytes | None = None

    @property
    def ranking(self) -> list[int]:
        """Class indices, likeliest first."""
        return np.argsort(-self.scores, kind="stable").tolist()

    @property
    def label(self) -> str:
        """The likeliest class."""
        return self.classes[int(np.argmax(self.scores))]

    @property
    def probability(self) -> float:
        """Probability of the likeliest class."""
        return float(self.probabilities[int(np.argmax(self.scores))])

    def top(self, count: int | None = None) -> list[tuple[str, float, float]]:
        """(name, probability, score) of the `count` likeliest classes, or of all."""
        return [
            (self.classes[i], float(self.probabilities[i]), float(self.scores[i]))
            for i in self.ranking[:count]
        ]

    def __repr__(self) -> str:
        likeliest = ", ".join(f"{name} {probability:.1%}" for name, probability, _ in self.top(3))
        unknown = "unknown, nearest: " if self.unknown else ""
        return f"<Prediction by {self.model.name}: {unknown}{likeliest}>"


@dataclass(frozen=True)
class Failure:
    """Reason why a mesh has no prediction. fault: stable error code; message: for people."""

    fault: str
    message: str

    @classmethod
    def of(cls, error: MeshError | OSError) -> "Failure":
        """From the error that reading or classifying a file raised."""
        if isinstance(error, MeshError):
            return cls(error.fault, str(error))
        return cls("unreadable", f"cannot be opened: {error.strerror}")


Result: TypeAlias = Prediction | Failure
