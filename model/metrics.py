"""Metrics of classification, in NumPy. labels: M class indices. probabilities: M x N_c."""

import numpy as np
from numpy.typing import NDArray

CALIBRATION_BINS = 15
"""As in Guo et al. (2017), so that figures can be compared."""


def is_among_top(
    labels: NDArray[np.intp], probabilities: NDArray[np.float64], top: int = 1
) -> NDArray[np.bool_]:
    """Whether each label is among the `top` likeliest classes; of equals, the first counts."""
    ranking = np.argsort(-probabilities, axis=1, kind="stable")[:, :top]
    return (ranking == labels[:, None]).any(axis=1)


def confusion_matrix(
    labels: NDArray[np.intp], probabilities: NDArray[np.float64]
) -> NDArray[np.intp]:
    """Counts by label (rows) and likeliest class (columns), N_c x N_c."""
    counts = np.zeros((probabilities.shape[1],) * 2, dtype=np.intp)
    np.add.at(counts, (labels, probabilities.argmax(axis=1)), 1)
    return counts


def calibration_error(
    labels: NDArray[np.intp], probabilities: NDArray[np.float64], bins: int = CALIBRATION_BINS
) -> float:
    """Expected calibration error.

    The highest probabilities fall into bins of equal width, bin i of b being (i/b, (i+1)/b]; the
    error is the mean of |share right - mean highest probability|, weighted by the bins' counts.
    """
    confidence = probabilities.max(axis=1)
    places = np.clip(np.ceil(confidence * bins).astype(np.intp) - 1, 0, bins - 1)
    # A difference of sums is the difference of means times the count of the bin.
    right = is_among_top(labels, probabilities)
    apart = np.bincount(places, weights=right - confidence, minlength=bins)
    return float(np.abs(apart).sum() / len(labels))


def negative_log_likelihood(labels: NDArray[np.intp], probabilities: NDArray[np.float64]) -> float:
    """Mean of -ln(probability of the label); one of 0 counts as the smallest normal float."""
    stated = probabilities[np.arange(len(labels)), labels]
    return float(-np.log(np.maximum(stated, np.finfo(np.float64).tiny)).mean())
