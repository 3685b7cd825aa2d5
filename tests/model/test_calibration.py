"""Probabilities that come true, and a limit that few known meshes lie above."""

import numpy as np
import pytest

from meshconv3d.model.calibration import (
    KNOWN_REFUSED,
    OTHERS_SHARE,
    TYPICAL_KNOWN,
    Calibration,
    calibrate,
    fit_known,
    fit_same_shape,
    fit_temperature,
    softmax,
)


def draw(scores: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    """Labels that come as often as the softmax says."""
    return np.array([rng.choice(len(p), p=p) for p in softmax(scores)])


@pytest.mark.parametrize("temperature", [0.3, 1.0, 4.0])
def test_the_temperature_that_spoilt_the_scores_is_found(temperature: float) -> None:
    rng = np.random.default_rng(0)
    scores = rng.normal(0, 2, (4000, 6))
    labels = draw(scores, rng)
    assert fit_temperature(scores * temperature, labels) == pytest.approx(temperature, rel=0.1)


def test_scores_that_are_always_right_do_not_run_away() -> None:
    scores = np.eye(3) * 5
    assert 0.05 <= fit_temperature(scores, np.arange(3)) < 0.5


def test_few_known_meshes_lie_above_the_limit() -> None:
    rng = np.random.default_rng(0)
    scores, novelty = rng.normal(size=(1000, 3)), rng.normal(-50, 20, 1000)
    calibration = calibrate(scores, novelty, draw(scores, rng))
    assert np.mean(novelty > calibration.novelty_limit) == pytest.approx(KNOWN_REFUSED, abs=2e-3)
    assert calibration.meshes == 1000
    typical = calibration.known_probability(float(np.median(novelty)))
    assert typical == pytest.approx(TYPICAL_KNOWN, abs=1e-3)
    assert calibration.known_probability(calibration.novelty_limit) == 0.5


def test_the_probability_of_a_class_is_that_of_bayes() -> None:
    """Two normal distributions of one variance have log odds that are linear."""
    rng = np.random.default_rng(0)
    spread, known, others = 2.0, -3.0, 5.0
    limit, scale = fit_known(rng.normal(known, spread, 20_000), rng.normal(others, spread, 5_000))
    exact = spread**2 / (others - known)
    odds = np.log((1 - OTHERS_SHARE) / OTHERS_SHARE)
    assert scale == pytest.approx(exact, rel=0.1)
    assert limit == pytest.approx((known + others) / 2 + exact * odds, abs=0.1)


@pytest.mark.parametrize("others", [None, np.full(5, 9.0), np.full(5, -9.0), np.zeros(5)])
def test_any_scores_have_a_limit(others: np.ndarray | None) -> None:
    for known in (np.zeros(1), np.zeros(30), np.linspace(-1, 1, 9)):
        limit, scale = fit_known(known, others)
        assert np.isfinite(limit)
        assert 0 < scale < np.inf


def test_a_temperature_is_positive() -> None:
    with pytest.raises(ValueError, match="greater than"):
        Calibration(temperature=0, novelty_limit=1, novelty_scale=1.0, meshes=1)


def test_copies_are_of_one_shape_and_the_nearest_others_are_not() -> None:
    rng = np.random.default_rng(0)
    shapes = rng.normal(size=(60, 32))
    points = np.repeat(shapes, 3, axis=0) + rng.normal(0, 0.1, (180, 32))
    points /= np.linalg.norm(points, axis=1, keepdims=True)
    meshes = np.repeat(np.arange(60), 3)
    same_shape = fit_same_shape(points.astype(np.float32), meshes)
    calibration = Calibration(1.0, 0.0, 1.0, 180, same_shape)
    cosines = points @ points.T
    probabilities = calibration.same_shape_probability(cosines)
    same = meshes[:, None] == meshes
    assert probabilities[same].min() > 0.9
    assert probabilities[~same].max() < 0.1
    assert calibration.same_shape_probability(np.ones(1)) > 0.999
    for probability in (0.2, 0.5, 0.9):
        cosine = calibration.same_shape_cosine(probability)
        found = calibration.same_shape_probability(np.array([cosine]))
        assert found == pytest.approx(probability, abs=1e-6)
    assert fit_same_shape(points[::3].astype(np.float32), np.arange(60)) is None


def test_softmax_bears_any_logits() -> None:
    assert softmax(np.array([1e30, 1e30, -1e30])).tolist() == [0.5, 0.5, 0]
    logits = np.array([0.5, -1.25, 3], np.float32)
    powers = np.exp(logits.astype(float))
    np.testing.assert_allclose(softmax(logits), powers / powers.sum())
