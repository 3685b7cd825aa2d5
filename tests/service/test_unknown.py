"""What is unlike everything a model was trained on is called unknown, everywhere."""

import json
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import httpx
import numpy as np
import onnx
import pytest

from meshconv3d.model.calibration import Calibration, softmax
from meshconv3d.service.classifier import Classifier
from meshconv3d.service.models import ModelFile
from tests.articulated import sample_paths
from tests.commands import at_a_terminal, meshconv3d

SAMPLE = sample_paths()["ants"]


@pytest.fixture(scope="module")
def model_with(model_file: Path, tmp_path_factory: pytest.TempPathFactory) -> Callable:
    """Makes a model file from the small one with another calibration on its card."""

    def make(calibration: Calibration | None) -> Path:
        path = tmp_path_factory.mktemp("calibrated") / "some.onnx"
        graph = onnx.load(model_file)
        card = replace(ModelFile.read(str(model_file)).open().card, name="some")
        onnx.helper.set_model_props(graph, replace(card, calibration=calibration).to_properties())
        path.write_bytes(graph.SerializeToString())
        return path

    return make


@pytest.fixture(scope="module")
def strict(model_with: Callable) -> Path:
    """A model to which everything is unknown."""
    return model_with(Calibration(temperature=2.0, novelty_limit=-1e9, novelty_scale=1.0, meshes=9))


def test_the_limit_decides(strict: Path, model_file: Path) -> None:
    assert Classifier.load(str(strict)).classify(SAMPLE).unknown is True
    assert Classifier.load(str(model_file)).classify(SAMPLE).unknown is False


def test_the_temperature_tempers(model_file: Path) -> None:
    result = Classifier.load(str(model_file)).classify(SAMPLE)
    np.testing.assert_allclose(result.probabilities, softmax(result.scores / 2.0))


def test_no_class_of_an_unknown_mesh_is_likely(model_with: Callable) -> None:
    """Probabilities are those of the classes, times that of being of one."""
    novelty = Classifier.load(str(model_with(None))).classify(SAMPLE).novelty
    calibration = Calibration(2.0, novelty_limit=novelty - 1, novelty_scale=0.5, meshes=9)
    result = Classifier.load(str(model_with(calibration))).classify(SAMPLE)
    assert result.unknown is True
    assert result.probabilities.sum() == pytest.approx(1 / (1 + np.exp(2)), rel=1e-3)
    np.testing.assert_allclose(
        result.probabilities / result.probabilities.sum(), softmax(result.scores / 2.0)
    )


def test_a_model_that_was_not_calibrated_has_no_opinion(model_with: Callable) -> None:
    result = Classifier.load(str(model_with(None))).classify(SAMPLE)
    assert result.unknown is None
    np.testing.assert_allclose(result.probabilities, softmax(result.scores))


def test_a_line_says_so(strict: Path) -> None:
    record = json.loads(meshconv3d("classify", SAMPLE, "--model", strict).stdout)
    assert record["unknown"] is True
    assert record["class"] == record["scores"][0]["class"]


def test_the_table_says_so(strict: Path) -> None:
    _, (_, row) = at_a_terminal("classify", SAMPLE.name, "--model", strict, cwd=SAMPLE.parent)
    name, verdict, nearest, label, _ = row.split()
    assert (name, verdict, nearest) == (SAMPLE.name, "unknown", "nearest")
    assert label in {"ball", "box", "ring"}
    assert "%" not in row


def test_the_service_says_so(start: Callable, strict: Path) -> None:
    service = start("--model", strict)
    url = f"{service.url}/v1/classify?model=some"
    reply = httpx.post(url, files={"file": SAMPLE.read_bytes()})
    assert reply.json()["unknown"] is True
    card = httpx.get(f"{service.url}/v1/models/some").json()
    assert card["calibration"]["novelty_limit"] == -1e9


def test_the_card_tells_the_limit(strict: Path) -> None:
    assert "novelty_limit: -1000000000.0" in meshconv3d("inspect", strict).stdout
