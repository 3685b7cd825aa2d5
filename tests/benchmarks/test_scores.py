"""Figures against answers worked out by hand."""

import numpy as np
import pytest

from benchmarks.scores import figures

NONE = np.array([], int)


def ranked(label: int, rank: int, classes: int = 7) -> np.ndarray:
    """Scores that put a class on a rank, 0 the first."""
    others = [c for c in range(classes) if c != label]
    order = [*others[:rank], label, *others[rank:]]
    return -np.argsort(order).astype(float)


def test_each_file_counts_once_but_in_balance_each_class() -> None:
    labels = np.array([0, 0, 0, 0, 1, 2])
    ranks = [0, 0, 0, 1, 4, 5]
    scores = np.stack([ranked(*pair) for pair in zip(labels, ranks, strict=True)])
    assert figures(scores, labels, NONE) == pytest.approx(
        {"top1": 3 / 6, "top5": 5 / 6, "balanced": (3 / 4 + 0 + 0) / 3}
    )


def test_a_refused_file_is_a_wrong_answer() -> None:
    labels = np.array([0, 1, 1])
    scores = np.stack([ranked(label, 0) for label in labels])
    assert figures(scores, labels, refused=np.array([1, 6])) == pytest.approx(
        {"top1": 3 / 5, "top5": 3 / 5, "balanced": (1 + 2 / 3 + 0) / 3}
    )
