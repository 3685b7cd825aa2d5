"""Calibration: temperature scaling and the out-of-distribution threshold."""

from typing import Annotated

import numpy as np
from numpy.typing import NDArray
from pydantic import ConfigDict, Field
from pydantic.dataclasses import dataclass

# Of the validation meshes, the share that is unknown where there are no others to measure by
# (unless said otherwise), and the probability with which a typical one is then known.
KNOWN_REFUSED = 0.02
TYPICAL_KNOWN = 0.98
# Share of meshes of no class among those that people ask for, as far as it is assumed.
OTHERS_SHARE = 0.2
# Added to the distance of embeddings, so that its logarithm is bounded.
LEAST_DISTANCE = 0.01
# Bounds of the scale, for scores that are all alike or tell nothing.
LEAST_SCALE, MOST_SCALE = 1e-3, 1e6
# Keeps a logistic function finite that parts its points perfectly.
RIDGE = 1e-5


@dataclass(frozen=True, config=ConfigDict(extra="forbid"))
class Calibration:
    """Calibration of a model, measured on validation meshes.

    temperature: divides the scores before the softmax, so that of known meshes whose class has
    probability p a share p is right. novelty_limit, novelty_scale: the probability that a mesh is
    of one of the classes is a logistic function of its out-of-distribution score, 1/2 at the limit
    and falling by a factor e in its odds with each scale; a mesh above the limit is unknown.
    meshes: how many it was measured on, varied copies included. same_shape: the factor and the
    constant of a logistic function, from the logarithm of the distance of two embeddings to the
    probability that they are of one shape; None where there were no varied copies.
    """

    temperature: Annotated[float, Field(ge=1e-3, le=1e3)]
    novelty_limit: Annotated[float, Field(allow_inf_nan=False)]
    novelty_scale: Annotated[float, Field(gt=0, allow_inf_nan=False)]
    meshes: int
    same_shape: tuple[float, float] | None = None

    def known_probability(self, novelty: float) -> float:
        """Probability that a mesh is of one of the classes, from its out-of-distribution score."""
        return float(_logistic((self.novelty_limit - novelty) / self.novelty_scale))

    def same_shape_probability(self, cosines: NDArray) -> NDArray[np.float64]:
        """Probability that two meshes are of one shape, from the cosine of their embeddings."""
        assert self.same_shape is not None
        factor, constant = self.same_shape
        return _logistic(factor * _log_distance(cosines) + constant)

    def same_shape_cosine(self, probability: float) -> float:
        """The cosine of two embeddings at which `same_shape_probability` is this."""
        assert self.same_shape is not None
        factor, constant = self.same_shape
        odds = np.log(probability / (1 - probability))
        distance = max(float(np.exp((odds - constant) / factor)) - LEAST_DISTANCE, 0.0)
        return 1 - distance**2 / 2


def calibrate(
    scores: NDArray,
    novelty: NDArray,
    labels: NDArray[np.int64],
    same_shape: tuple[float, float] | None = None,
    others: NDArray | None = None,
    refused: float = KNOWN_REFUSED,
) -> Calibration:
    """Fit to validation meshes: scores, M x N_c logits; novelty, M; labels, M.

    others: out-of-distribution scores of meshes of no class, if there are any. refused: share of
    the validation meshes that is unknown where there are none.
    """
    limit, scale = fit_known(novelty, others, refused)
    return Calibration(
        temperature=round(fit_temperature(scores, labels), 4),
        novelty_limit=round(limit, 4),
        novelty_scale=round(scale, 4),
        meshes=len(labels),
        same_shape=same_shape,
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


def fit_known(
    known: NDArray, others: NDArray | None = None, refused: float = KNOWN_REFUSED
) -> tuple[float, float]:
    """`novelty_limit` and `novelty_scale` for out-of-distribution scores of meshes of the classes,
    and of others, which count OTHERS_SHARE.

    Without others, the share `refused` of the known is above the limit.
    """
    if others is None or not len(others):
        middle, limit = np.quantile(known, (0.5, 1 - refused))
        odds = TYPICAL_KNOWN / (1 - TYPICAL_KNOWN)
        return float(limit), float(max((limit - middle) / np.log(odds), LEAST_SCALE))
    points = np.concatenate([known, others]).astype(np.float64)
    centre, spread = points.mean(), max(points.std(), LEAST_SCALE)
    targets = np.arange(len(points)) < len(known)
    weights = np.where(targets, (1 - OTHERS_SHARE) / len(known), OTHERS_SHARE / len(others))
    factor, constant = _fit_logistic((points - centre) / spread, targets, weights)
    scale = spread / max(-factor, spread / MOST_SCALE)
    return float(centre + constant * scale), float(scale)


def fit_same_shape(
    embeddings: NDArray[np.float32], meshes: NDArray[np.int64]
) -> tuple[float, float] | None:
    """The factor and the constant of `Calibration.same_shape`; None without varied copies.

    embeddings: M x A. meshes: M, the number of the mesh that each is, or is a copy of. Compares
    copies of one mesh, and each mesh with the nearest of another, both kinds counting the same.
    """
    cosines = embeddings.astype(np.float64) @ embeddings.T
    alike = meshes[:, None] == meshes
    np.fill_diagonal(alike, False)
    if not alike.any() or len(np.unique(meshes)) < 2:
        return None
    same = cosines[alike]
    other = np.where(meshes[:, None] == meshes, -1, cosines).max(axis=1)
    points = _log_distance(np.concatenate([same, other]))
    targets = np.concatenate([np.ones(len(same)), np.zeros(len(other))])
    weights = np.where(targets == 1, 0.5 / len(same), 0.5 / len(other))
    factor, constant = _fit_logistic(points, targets, weights)
    return round(factor, 4), round(constant, 4)


def _log_distance(cosines: NDArray) -> NDArray[np.float64]:
    """Logarithm of the distance of unit vectors, bounded below."""
    squares = np.maximum(2 - 2 * cosines.astype(np.float64), 0)
    return np.log(np.sqrt(squares) + LEAST_DISTANCE)


def _logistic(values: NDArray | float) -> NDArray[np.float64]:
    return 1 / (1 + np.exp(-np.clip(values, -700, 700)))


def _fit_logistic(points: NDArray, targets: NDArray, weights: NDArray) -> tuple[float, float]:
    """Factor and constant of the logistic function of the highest likelihood.

    points, targets (0 or 1) and weights: N each.
    """
    columns = np.stack([points, np.ones_like(points)], axis=1)
    fitted = np.zeros(2)
    for _ in range(50):  # Newton's method; the loss is convex
        shares = _logistic(columns @ fitted)
        slope = columns.T @ (weights * (shares - targets)) + RIDGE * fitted
        curves = weights * shares * (1 - shares)
        bend = (columns * curves[:, None]).T @ columns + RIDGE * np.eye(2)
        fitted = fitted - np.linalg.solve(bend, slope)
    factor, constant = fitted.tolist()
    return factor, constant


def softmax(scores: NDArray) -> NDArray[np.float64]:
    """Probabilities from logits, over the last axis."""
    return np.exp(log_softmax(scores))


def log_softmax(scores: NDArray) -> NDArray[np.float64]:
    """Logarithms of the softmax over the last axis."""
    shifted = scores.astype(np.float64) - scores.max(axis=-1, keepdims=True)
    return shifted - np.log(np.exp(shifted).sum(axis=-1, keepdims=True))
