"""Result types: the prediction of one mesh, or the reason why there is none.

They cross the worker border and every function border of the service. JSON, CSV and tables are made
of them at the edge, by `service.records`.
"""

from dataclasses import dataclass
from typing import NamedTuple, TypeAlias

import numpy as np
from numpy.typing import NDArray

from meshconv3d.model.errors import MeshError
from meshconv3d.model.preparation import MeshReport


@dataclass(frozen=True)
class ModelId:
    """Name of a model and SHA-256 of its file."""

    name: str
    sha256: str


class RankedClass(NamedTuple):
    """A class by name, its calibrated probability, and its score, a logit."""

    name: str
    probability: float
    score: float


@dataclass(frozen=True, eq=False)
class Prediction:
    """Class of one mesh.

    - `label`: name of the likeliest class. `probability`: its calibrated probability.
      `probabilities`: together, that of being of one of the classes.
    - `unknown`: whether the mesh is unlike every class, or left with less than 15 % of its area by
      simplification, so that `label` is only the nearest; None if the model cannot tell.
    - `novelty`: out-of-distribution score, which `unknown` compares with the model's limit.
    - `classes`: names of the N_c classes. `scores`, N_c float32 logits, and `probabilities`, N_c
      float64, are in their order; `top` has them by name.
    - `embedding`: A float32 of unit length; the inner product of two is their cosine, near 1 for
      meshes of the same shape.
    - `space`: names the space of the embedding; those of one space can be compared, whether of one
      model or of others taught on it.
    - `radius`: size of the mesh in the units of its file, from its centroid to its farthest vertex.
      `chirality`: see `model.chirality`; the mirror image has it with the other sign.
    - `report`: counts of what preparation found and changed, a `MeshReport`.
    - `timings_ms`: milliseconds of each stage: read, prepare, topology, infer, explain.
    - `model`: name and SHA-256 of the model file.
    - `explanation`, the bytes of a GLB, PLY or JSON file, and `picture`, of a PNG: None unless
      requested, as the command line and the service do.
    """

    model: ModelId
    classes: tuple[str, ...]
    scores: NDArray[np.float32]
    probabilities: NDArray[np.float64]
    novelty: float
    unknown: bool | None
    embedding: NDArray[np.float32]
    space: str
    radius: float
    chirality: NDArray[np.float64]
    report: MeshReport
    timings_ms: dict[str, float]
    explanation: bytes | None = None
    picture: bytes | None = None

    @property
    def label(self) -> str:
        """Name of the likeliest class."""
        return self.top(1)[0].name

    @property
    def probability(self) -> float:
        """Calibrated probability of the likeliest class."""
        return self.top(1)[0].probability

    def top(self, count: int | None = None) -> list[RankedClass]:
        """The `count` likeliest classes, or all, likeliest first."""
        order = np.argsort(-self.scores, kind="stable")[:count]
        return [
            RankedClass(self.classes[i], float(self.probabilities[i]), float(self.scores[i]))
            for i in order
        ]

    def __repr__(self) -> str:
        first, *others = (f"{one.name} {one.probability:.1%}" for one in self.top(3))
        nearest = "unknown, nearest is " if self.unknown else ""
        following = f", then {', '.join(others)}" if others else ""
        return f"<Prediction: {nearest}{first}{following}>"


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
