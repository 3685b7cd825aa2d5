"""Probabilities that come true, and a limit that few known meshes lie above."""

import numpy as np
import pytest

from meshconv3d.model.calibration import (
    KNOWN_REFUSED,
    Calibration,
    calibrate,
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


def test_a_temperature_is_positive() -> None:
    with pytest.raises(ValueError, match="greater than"):
        Calibration(temperature=0, novelty_limit=1, meshes=1)


def test_softmax_bears_any_logits() -> None:
    assert softmax(np.array([1e30, 1e30, -1e30])).tolist() == [0.5, 0.5, 0]
    logits = np.array([0.5, -1.25, 3], np.float32)
    powers = np.exp(logits.astype(float))
    np.testing.assert_allclose(softmax(logits), powers / powers.sum())
