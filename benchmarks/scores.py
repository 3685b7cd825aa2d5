"""Accuracy of the scores of a method."""

import numpy as np
from numpy.typing import NDArray
from sklearn.metrics import balanced_accuracy_score, top_k_accuracy_score


def figures(
    scores: NDArray[np.floating], labels: NDArray[np.int64], refused: NDArray[np.int64]
) -> dict[str, float]:
    """Top-1, top-5 and balanced accuracy.

    scores: N x N_c, finite; the class with the highest is the answer. labels: N, the right ones.
    refused: the right classes of files that have no scores. They count as wrong.
    """
    classes = np.arange(scores.shape[1])
    # For a refused file its own class comes last.
    scores = np.concatenate([scores, -np.eye(len(classes))[refused]])
    labels = np.concatenate([labels, refused])
    return {
        "top1": float(top_k_accuracy_score(labels, scores, k=1, labels=classes)),
        "top5": float(top_k_accuracy_score(labels, scores, k=5, labels=classes)),
        "balanced": float(balanced_accuracy_score(labels, scores.argmax(axis=1))),
    }
