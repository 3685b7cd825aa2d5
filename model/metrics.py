"""Metrics of classification: accuracy, recall, confusion, calibration. NumPy alone."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

CALIBRATION_BINS = 15
"""As in Guo et al. (2017), so that figures can be compared."""


@dataclass(frozen=True, eq=False)
class Predictions:
    """Predictions for labelled files, in any order.

    labels: the true class of each file. probabilities: files x N_c, rows that sum to 1. refused:
    whether a file has no answer; its row of probabilities is not read. Raises ValueError for no
    files, for shapes that do not fit, and for labels that are no class.
    """

    labels: NDArray[np.intp]
    probabilities: NDArray[np.float64]
    refused: NDArray[np.bool_]

    def __post_init__(self) -> None:
        files = len(self.labels)
        shapes = [self.labels.shape, self.probabilities.shape[:1], self.refused.shape]
        if not files or self.probabilities.ndim != 2 or shapes != [(files,)] * 3:
            raise ValueError(
                "expected files, files x N_c and files of at least one file, got "
                f"{self.labels.shape}, {self.probabilities.shape} and {self.refused.shape}"
            )
        if self.labels.min() < 0 or self.labels.max() >= self.classes:
            raise ValueError(
                f"expected labels in 0..{self.classes - 1}, got {self.labels.min()} to "
                f"{self.labels.max()}"
            )

    @property
    def classes(self) -> int:
        """N_c."""
        return self.probabilities.shape[1]

    @property
    def answered(self) -> "Predictions":
        """Those that were not refused. Raises ValueError if that leaves none."""
        kept = ~self.refused
        return Predictions(self.labels[kept], self.probabilities[kept], self.refused[kept])


def right(predictions: Predictions, top: int = 1) -> NDArray[np.bool_]:
    """Whether the class of each file is among the `top` likeliest; False for a refused one."""
    ranking = np.argsort(-predictions.probabilities, axis=1, kind="stable")
    hits = (ranking[:, :top] == predictions.labels[:, None]).any(axis=1)
    return hits & ~predictions.refused


def accuracy(predictions: Predictions, top: int = 1) -> float:
    """Share of all files that are right; refused ones count as wrong."""
    return float(right(predictions, top).mean())


def class_counts(predictions: Predictions) -> NDArray[np.intp]:
    """Files of each class, N_c."""
    return np.bincount(predictions.labels, minlength=predictions.classes)


def refused_counts(predictions: Predictions) -> NDArray[np.intp]:
    """Refused files of each class, N_c."""
    return np.bincount(predictions.labels[predictions.refused], minlength=predictions.classes)


def confusion_matrix(predictions: Predictions) -> NDArray[np.intp]:
    """Answered files by class (rows) and answer (columns), N_c x N_c."""
    counts = np.zeros((predictions.classes, predictions.classes), dtype=np.intp)
    kept = ~predictions.refused
    answers = predictions.probabilities.argmax(axis=1)
    np.add.at(counts, (predictions.labels[kept], answers[kept]), 1)
    return counts


def recalls(predictions: Predictions) -> NDArray[np.float64]:
    """Share of each class's files that are right, N_c; NaN for a class without files."""
    return _ratio(confusion_matrix(predictions).diagonal(), class_counts(predictions))


def precisions(predictions: Predictions) -> NDArray[np.float64]:
    """Share of each class's answers that are right, N_c; NaN for a class that is no answer."""
    confusion = confusion_matrix(predictions)
    return _ratio(confusion.diagonal(), confusion.sum(axis=0))


def balanced_accuracy(predictions: Predictions) -> float:
    """Mean recall of the classes that have files."""
    return float(np.nanmean(recalls(predictions)))


def calibration_error(predictions: Predictions, bins: int = CALIBRATION_BINS) -> float:
    """Expected calibration error over the answered files.

    Files fall into bins of equal width by their highest probability, bin i of b holding those in
    (i/b, (i+1)/b]; the error is the mean over bins of |share right - mean highest probability|,
    weighted by their files. Raises ValueError if every file was refused.
    """
    answered = predictions.answered
    confidence = answered.probabilities.max(axis=1)
    places = np.clip(np.ceil(confidence * bins).astype(np.intp) - 1, 0, bins - 1)
    # A difference of sums is the difference of means times the files of the bin.
    apart = np.bincount(places, weights=right(answered) - confidence, minlength=bins)
    return float(np.abs(apart).sum() / len(confidence))


def negative_log_likelihood(predictions: Predictions) -> float:
    """Mean over the answered files of -ln(probability of the true class).

    A probability of 0 counts as the smallest normal float, so that the mean stays finite. Raises
    ValueError if every file was refused.
    """
    answered = predictions.answered
    stated = answered.probabilities[np.arange(len(answered.labels)), answered.labels]
    return float(-np.log(np.maximum(stated, np.finfo(np.float64).tiny)).mean())


def _ratio(part: NDArray[np.intp], whole: NDArray[np.intp]) -> NDArray[np.float64]:
    """part / whole, NaN over nothing."""
    return np.divide(part, whole, out=np.full(len(whole), np.nan), where=whole > 0)
