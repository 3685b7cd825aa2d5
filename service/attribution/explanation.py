"""Contribution of every face of an uploaded mesh to the score of a class."""

import dataclasses
import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from meshconv3d.model.attribution import onto_file
from meshconv3d.model.errors import Error
from meshconv3d.model.mesh import Mesh
from meshconv3d.model.preparation import face_areas
from meshconv3d.service.classifier import Classifier, timed
from meshconv3d.service.prediction import Prediction

# Share of the surface within the range of the colour map; the rest has its last colours.
SHOWN_SHARE = 0.95
# Minimum area of a face, as a share of the mesh's, in densities.
LEAST_AREA = 1e-12


class NotExplained(Error):
    """Error of an explanation that cannot be made. fault: stable error code; the message says what
    to do."""

    def __init__(self, fault: str, message: str) -> None:
        super().__init__(message)
        self.fault = fault


@dataclass(frozen=True, eq=False)
class Explanation:
    """Sources of the score of a class, which is the bias plus the sum of the contributions.

    mesh: as uploaded. contributions: F float64, in the order of its faces.
    """

    prediction: Prediction
    class_index: int
    mesh: Mesh
    contributions: NDArray[np.float64]
    bias: float

    @property
    def label(self) -> str:
        """The explained class."""
        return self.prediction.classes[self.class_index]

    @property
    def score(self) -> float:
        """Its score, a logit."""
        return float(self.prediction.scores[self.class_index])

    @cached_property
    def _areas(self) -> NDArray[np.float64]:
        return face_areas(self.mesh.vertices, self.mesh.faces)

    @cached_property
    def densities(self) -> NDArray[np.float64]:
        """Contributions per share of the area, F float64.

        Unlike contributions, they do not depend on the size of faces. Their mean over the surface
        is the score without the bias.
        """
        shares = self._areas / self._areas.sum()
        return self.contributions / np.maximum(shares, LEAST_AREA)

    @cached_property
    def limit(self) -> float:
        """Density of the last colours: SHOWN_SHARE of the surface has a lower one."""
        sizes = np.abs(self.densities)
        order = np.argsort(sizes)
        covered = np.cumsum(self._areas[order])
        return float(sizes[order][np.searchsorted(covered, SHOWN_SHARE * covered[-1])])


def explained_class(classes: Sequence[str], pooling: str, label: str | None) -> None:
    """Raises NotExplained if a model cannot explain a class; None is the likeliest."""
    if pooling == "learned":
        raise NotExplained(
            "learned-pooling",
            "a model with learned pooling does not tell which faces it gathers; explain with a "
            "model whose pooling is geometric",
        )
    if label is not None and label not in classes:
        raise NotExplained(
            "unknown-class", f"the model knows no class {label!r}, but {', '.join(classes)}"
        )


def explain(
    classifier: Classifier,
    source: str | os.PathLike[str] | bytes,
    name: str | None = None,
    label: str | None = None,
    pieces: Mapping[str, bytes] | None = None,
) -> Explanation:
    """Classify one file as `Classifier.classify` does, and explain the class `label`, or the
    likeliest. pieces: see `load_mesh`.

    Raises NotExplained, and what `Classifier.classify` raises.
    """
    config = classifier.model.card.config
    explained_class(config.classes, config.pooling, label)
    mesh, timings = classifier.read(source, name, pieces)
    passed = classifier.run(mesh, timings)
    result = passed.prediction
    timings = dict(result.timings_ms)
    index = config.classes.index(label or result.label)
    with timed(timings, "explain"):
        placed = passed.prepared.moved(passed.placement.into_file(passed.prepared.vertices))
        added = onto_file(passed.contributions(index), placed, mesh)
    bias = float(result.scores[index]) - float(passed.evidence[:, index].mean(dtype=np.float64))
    result = dataclasses.replace(result, timings_ms=timings)
    return Explanation(result, index, mesh, added, bias)
