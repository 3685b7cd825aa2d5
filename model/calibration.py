"""Calibration: temperature scaling and the out-of-distribution threshold."""

from typing import Annotated

import numpy as np
from numpy.typing import NDArray
from pydantic import ConfigDict, Field
from pydantic.dataclasses import dataclass

# Share of the validation meshes whose out-of-distribution score is above the threshold.
KNOWN_REFUSED = 0.02


@dataclass(frozen=True, config=ConfigDict(extra="forbid"))
class Calibration:
    """Calibration of a model, measured on validation meshes.

    temperature: divides the scores before the softmax, so that of answers with probability p a
    share p is right. novelty_limit: a mesh with a higher out-of-distribution score is unknown.
    meshes: how many it was measured on, varied copies included.
    """

    temperature: Annotated[float, Field(ge=1e-3, le=1e3)]
    novelty_limit: Annotated[float, Field(allow_inf_nan=False)]
    meshes: int


def calibrate(scores: NDArray, novelty: NDArray, labels: NDArray[np.int64]) -> Calibration:
    """Fit to validation meshes: scores, M x N_c logits; novelty, M; labels, M."""
    return Calibration(
        temperature=round(fit_temperature(scores, labels), 4),
        novelty_limit=round(float(np.quantile(novelty, 1 - KNOWN_REFUSED)), 4),
        meshes=len(labels),
    )


def fit_temperature(scores: NDArray, labels: NDArray[np.int64]) -> float:
    """The temperature, 1/20 to 20, of the highest likelihood of the labels (Guo et al., 2017).

    The loss has one minimum: it is convex in the inverse of the temperature.
    """

    def loss(log_temperature: float) -> float:
        logs = log_softmax(scores / np.exp(log_temperature))
        return -float(logs[np.arange(len(labels)), labels].mean())

    low, high = -np.log(20), np.log(20)
    while high - low > 1e-6:
        third = (high - low) / 3
        if loss(low + third) < loss(high - third):
            high -= third
        else:
            low += third
    return float(np.exp((low + high) / 2))


def softmax(scores: NDArray) -> NDArray[np.float64]:
    """Probabilities from logits, over the last axis."""
    return np.exp(log_softmax(scores))


def log_softmax(scores: NDArray) -> NDArray[np.float64]:
    """Logarithms of the softmax over the last axis."""
    shifted = scores.astype(np.float64) - scores.max(axis=-1, keepdims=True)
    return shifted - np.log(np.exp(shifted).sum(axis=-1, keepdims=True))
