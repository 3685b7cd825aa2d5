"""From scores to what may be believed: a temperature, and the limit of what is known."""

from typing import Annotated

import numpy as np
from numpy.typing import NDArray
from pydantic import ConfigDict, Field
from pydantic.dataclasses import dataclass

# Share of known validation meshes that the limit of novelty lies below.
KNOWN_REFUSED = 0.02


@dataclass(frozen=True, config=ConfigDict(extra="forbid"))
class Calibration:
    """What a model's answers mean, measured on meshes it was not trained on.

    temperature: scores are divided by it before the softmax; then, of answers with probability p,
    a share p is right. novelty_limit: a mesh above it is unlike every class. meshes: how many,
    varied copies included, it was measured on.
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
    """The temperature that makes the labels likeliest (Guo et al., 2017): from 1/20 to 20."""
    from scipy.optimize import minimize_scalar

    def loss(log_temperature: float) -> float:
        logs = log_softmax(scores / np.exp(log_temperature))
        return -float(logs[np.arange(len(labels)), labels].mean())

    best = minimize_scalar(loss, bounds=(-np.log(20), np.log(20)), method="bounded")
    return float(np.exp(best.x))


def softmax(scores: NDArray) -> NDArray[np.float64]:
    """Probabilities from logits, over the last axis."""
    return np.exp(log_softmax(scores))


def log_softmax(scores: NDArray) -> NDArray[np.float64]:
    """Logarithms of the softmax over the last axis."""
    shifted = scores.astype(np.float64) - scores.max(axis=-1, keepdims=True)
    return shifted - np.log(np.exp(shifted).sum(axis=-1, keepdims=True))
