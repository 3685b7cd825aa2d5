"""Statistics of answers: known values, and what holds of any."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as arrays

from meshconv3d.model import metrics
from meshconv3d.model.metrics import Predictions


def predictions(labels, probabilities, refused=None) -> Predictions:
    if refused is None:
        refused = [False] * len(labels)
    return Predictions(np.array(labels), np.array(probabilities, dtype=float), np.array(refused))


KNOWN = predictions(
    [0, 0, 0, 1, 1, 2],
    [
        [0.8, 0.1, 0.1],
        [0.3, 0.5, 0.2],
        [0.4, 0.5, 0.1],
        [0.1, 0.9, 0.0],
        [0.2, 0.2, 0.6],
        [1.0, 0.0, 0.0],  # refused: not looked at
    ],
    [False, False, False, False, False, True],
)
"""Three classes; two files of six are right, the last is refused."""


def test_accuracies_known_by_hand():
    assert metrics.right(KNOWN).tolist() == [True, False, False, True, False, False]
    assert metrics.accuracy(KNOWN) == pytest.approx(2 / 6)
    # The second likeliest of [0.2, 0.2, 0.6] is the first of the two that tie.
    assert metrics.accuracy(KNOWN, top=2) == pytest.approx(4 / 6)
    assert metrics.accuracy(KNOWN, top=3) == pytest.approx(5 / 6)
    assert metrics.balanced_accuracy(KNOWN) == pytest.approx((1 / 3 + 1 / 2 + 0) / 3)


def test_the_confusion_matrix_known_by_hand():
    assert metrics.confusion_matrix(KNOWN).tolist() == [[1, 2, 0], [0, 1, 1], [0, 0, 0]]
    assert metrics.refused_counts(KNOWN).tolist() == [0, 0, 1]
    assert metrics.class_counts(KNOWN).tolist() == [3, 2, 1]
    assert metrics.recalls(KNOWN) == pytest.approx([1 / 3, 1 / 2, 0])
    assert metrics.precisions(KNOWN) == pytest.approx([1, 1 / 3, 0])


def test_calibration_error_known_by_hand():
    """With two bins: 0.5, 0.5 in the lower, none right; 0.8, 0.9, 0.6 in the upper, two right."""
    expected = abs(0 - 0.5) * 2 / 5 + abs(2 / 3 - 2.3 / 3) * 3 / 5
    assert metrics.calibration_error(KNOWN, bins=2) == pytest.approx(expected)


def test_likelihood_known_by_hand():
    expected = -sum(map(math.log, (0.8, 0.3, 0.4, 0.9, 0.2))) / 5
    assert metrics.negative_log_likelihood(KNOWN) == pytest.approx(expected)


def test_a_certain_mistake_costs_much_but_not_everything():
    cost = metrics.negative_log_likelihood(predictions([1], [[1.0, 0.0]]))
    assert 700 < cost < 720


def test_what_no_file_is_of_has_no_recall_and_what_no_answer_is_no_precision():
    found = predictions([0, 0], [[0.9, 0.1, 0.0], [0.2, 0.8, 0.0]])
    assert metrics.recalls(found) == pytest.approx([0.5, np.nan, np.nan], nan_ok=True)
    assert metrics.precisions(found) == pytest.approx([1, 0, np.nan], nan_ok=True)
    assert metrics.balanced_accuracy(found) == 0.5


def test_all_refused_is_all_wrong_and_says_nothing_of_probabilities():
    found = predictions([0, 1], [[1.0, 0.0], [0.0, 1.0]], [True, True])
    assert metrics.accuracy(found, top=2) == metrics.balanced_accuracy(found) == 0
    assert metrics.refused_counts(found).tolist() == [1, 1]
    for measure in (metrics.calibration_error, metrics.negative_log_likelihood):
        with pytest.raises(ValueError, match="at least one file"):
            measure(found)


@pytest.mark.parametrize(
    ("labels", "probabilities", "refused", "says"),
    [
        ([], np.zeros((0, 3)), [], r"at least one file, got \(0,\)"),
        ([0, 1], [[0.5, 0.5]], [False, False], r"got \(2,\), \(1, 2\) and \(2,\)"),
        ([0], [0.5], [False], r"\(1,\), \(1,\) and \(1,\)"),
        ([0, 1], [[0.5, 0.5]] * 2, [False], r"and \(1,\)"),
        ([0, 2], [[0.5, 0.5]] * 2, [False, False], r"labels in 0..1, got 0 to 2"),
        ([-1, 1], [[0.5, 0.5]] * 2, [False, False], r"got -1 to 1"),
    ],
)
def test_what_does_not_fit_is_refused(labels, probabilities, refused, says):
    with pytest.raises(ValueError, match=says):
        predictions(labels, probabilities, refused)


@st.composite
def any_predictions(draw, refusals: bool = True) -> Predictions:
    files, classes = draw(st.integers(1, 30)), draw(st.integers(2, 7))
    scores = draw(arrays.arrays(float, (files, classes), elements=st.floats(-20, 20)))
    powers = np.exp(scores)
    labels = draw(arrays.arrays(int, files, elements=st.integers(0, classes - 1)))
    refused = draw(arrays.arrays(bool, files)) if refusals else np.zeros(files, bool)
    return Predictions(labels, powers / powers.sum(axis=1, keepdims=True), refused)


@given(any_predictions())
def test_confusion_and_refused_account_for_every_file(found: Predictions):
    confusion = metrics.confusion_matrix(found)
    rows = confusion.sum(axis=1) + metrics.refused_counts(found)
    assert rows.tolist() == metrics.class_counts(found).tolist()
    assert confusion.trace() == metrics.right(found).sum()
    assert confusion.trace() / len(found.labels) == pytest.approx(metrics.accuracy(found))


@given(any_predictions())
def test_more_guesses_are_no_worse_and_all_of_them_right(found: Predictions):
    shares = [metrics.accuracy(found, top) for top in range(1, found.classes + 1)]
    assert shares == sorted(shares)
    assert shares[-1] == pytest.approx(1 - found.refused.mean())


@given(any_predictions(refusals=False), st.randoms(use_true_random=False))
def test_the_order_of_the_files_does_not_matter(found: Predictions, random):
    order = list(range(len(found.labels)))
    random.shuffle(order)
    mixed = Predictions(found.labels[order], found.probabilities[order], found.refused[order])
    for measure in (
        metrics.accuracy,
        metrics.balanced_accuracy,
        metrics.calibration_error,
        metrics.negative_log_likelihood,
        metrics.confusion_matrix,
    ):
        assert measure(mixed) == pytest.approx(measure(found))


@given(any_predictions(refusals=False))
def test_perfect_answers_are_off_by_what_their_confidence_lacks(found: Predictions):
    labels = found.probabilities.argmax(axis=1)
    perfect = Predictions(labels, found.probabilities, found.refused)
    confidence = found.probabilities.max(axis=1)
    assert metrics.accuracy(perfect) == 1
    assert metrics.calibration_error(perfect) == pytest.approx(1 - confidence.mean())
    likelihood = metrics.negative_log_likelihood(perfect)
    assert likelihood == pytest.approx(-np.log(confidence).mean())


@given(any_predictions(refusals=False))
def test_calibration_error_is_at_least_the_overall_gap(found: Predictions):
    """As much as accuracy and mean confidence lie apart with one bin, and no less with more."""
    gap = abs(metrics.accuracy(found) - found.probabilities.max(axis=1).mean())
    assert metrics.calibration_error(found, bins=1) == pytest.approx(gap)
    assert gap - 1e-9 <= metrics.calibration_error(found) <= 1


@given(any_predictions(), st.integers(1, 4))
def test_with_classes_of_one_size_balance_changes_nothing(found: Predictions, size: int):
    labels = np.repeat(np.arange(found.classes), size)
    rows = np.resize(np.arange(len(found.labels)), len(labels))
    equal = Predictions(labels, found.probabilities[rows], found.refused[rows])
    assert metrics.balanced_accuracy(equal) == pytest.approx(metrics.accuracy(equal))


@given(any_predictions())
def test_what_is_said_of_a_refused_file_is_not_looked_at(found: Predictions):
    other = found.probabilities.copy()
    other[found.refused] = np.nan
    changed = Predictions(found.labels, other, found.refused)
    assert metrics.accuracy(changed) == metrics.accuracy(found)
    assert (metrics.confusion_matrix(changed) == metrics.confusion_matrix(found)).all()
    if not found.refused.all():
        for measure in (metrics.calibration_error, metrics.negative_log_likelihood):
            assert measure(changed) == measure(found)


def test_one_file_tells_the_bin_of_a_boundary():
    """Bins are closed above: 0.6 of five bins is in the third, beside 0.5."""
    found = predictions([0, 1], [[0.6, 0.4], [0.5000001, 0.4999999]])
    assert metrics.calibration_error(found, bins=5) == pytest.approx(abs(1 - 1.1) / 2, abs=1e-6)
