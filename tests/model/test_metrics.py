"""Metrics: known values, and properties of any predictions."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as arrays

from meshconv3d.model import metrics

LABELS = np.array([0, 0, 0, 1, 1])
PROBABILITIES = np.array(
    [[0.8, 0.1, 0.1], [0.3, 0.5, 0.2], [0.4, 0.5, 0.1], [0.1, 0.9, 0.0], [0.2, 0.2, 0.6]]
)
"""Three classes; two files of five are right."""


def test_values_known_by_hand():
    assert metrics.is_among_top(LABELS, PROBABILITIES).tolist() == [True, False, False, True, False]
    # The second likeliest of [0.2, 0.2, 0.6] is the first of the two that tie.
    second = metrics.is_among_top(LABELS, PROBABILITIES, top=2)
    assert second.tolist() == [True, True, True, True, False]
    confusion = metrics.confusion_matrix(LABELS, PROBABILITIES)
    assert confusion.tolist() == [[1, 2, 0], [0, 1, 1], [0, 0, 0]]
    # With two bins: 0.5, 0.5 in the lower, none right; 0.8, 0.9, 0.6 in the upper, two right.
    error = abs(0 - 0.5) * 2 / 5 + abs(2 / 3 - 2.3 / 3) * 3 / 5
    assert metrics.calibration_error(LABELS, PROBABILITIES, bins=2) == pytest.approx(error)
    likelihood = -sum(map(math.log, (0.8, 0.3, 0.4, 0.9, 0.2))) / 5
    found = metrics.negative_log_likelihood(LABELS, PROBABILITIES)
    assert found == pytest.approx(likelihood)


def test_a_certain_mistake_costs_much_but_not_everything():
    cost = metrics.negative_log_likelihood(np.array([1]), np.array([[1.0, 0.0]]))
    assert 700 < cost < 720


def test_bins_are_closed_above():
    """0.6 of five bins is in the third, beside 0.5."""
    found = np.array([[0.6, 0.4], [0.5000001, 0.4999999]])
    error = metrics.calibration_error(np.array([0, 1]), found, bins=5)
    assert error == pytest.approx(abs(1 - 1.1) / 2, abs=1e-6)


@st.composite
def any_predictions(draw) -> tuple[np.ndarray, np.ndarray]:
    files, classes = draw(st.integers(1, 30)), draw(st.integers(2, 7))
    powers = np.exp(draw(arrays.arrays(float, (files, classes), elements=st.floats(-20, 20))))
    labels = draw(arrays.arrays(int, files, elements=st.integers(0, classes - 1)))
    return labels, powers / powers.sum(axis=1, keepdims=True)


@given(any_predictions())
def test_more_guesses_are_no_worse_and_all_of_them_right(found):
    shares = [
        metrics.is_among_top(found[0], found[1], top).mean()
        for top in range(1, found[1].shape[1] + 1)
    ]
    assert shares == sorted(shares)
    assert shares[-1] == 1
    right = shares[0] * len(found[0])
    assert metrics.confusion_matrix(*found).trace() == pytest.approx(right)


@given(any_predictions(), st.randoms(use_true_random=False))
def test_the_order_of_the_files_does_not_matter(found, random):
    order = list(range(len(found[0])))
    random.shuffle(order)
    mixed = [array[order] for array in found]
    for measure in (
        metrics.calibration_error,
        metrics.negative_log_likelihood,
        metrics.confusion_matrix,
    ):
        assert measure(*mixed) == pytest.approx(measure(*found))


@given(any_predictions())
def test_calibration_error_is_at_least_the_overall_gap(found):
    """With one bin the distance of accuracy and mean confidence; with more, no less."""
    gap = abs(metrics.is_among_top(*found).mean() - found[1].max(axis=1).mean())
    assert metrics.calibration_error(*found, bins=1) == pytest.approx(gap)
    assert gap - 1e-9 <= metrics.calibration_error(*found) <= 1
