"""Public records of results."""

import errno
import json
import os
from pathlib import Path

import pytest

from meshconv3d.model.errors import UnusableMesh
from meshconv3d.service.classifier import Classifier
from meshconv3d.service.prediction import Failure, Prediction
from meshconv3d.service.records import answer, readable, record, to_json
from tests.articulated import sample_paths


@pytest.fixture(scope="module")
def classifier(model_file: Path) -> Classifier:
    return Classifier.load(str(model_file))


@pytest.fixture(scope="module")
def result(classifier: Classifier) -> Prediction:
    return classifier.classify(sample_paths()["ants"])


def test_an_answer_as_json(classifier: Classifier, result: Prediction) -> None:
    found = json.loads(to_json(answer("ants.obj", result)))
    assert list(found) == [
        *("file", "class", "probability", "unknown", "novelty"),
        *("scores", "model", "mesh", "timings_ms"),
    ]
    assert found["unknown"] is False
    assert found["novelty"] == pytest.approx(result.novelty, abs=1e-4)
    assert found["file"] == "ants.obj"
    assert found["class"] == result.label == found["scores"][0]["class"]
    assert found["probability"] == found["scores"][0]["probability"]
    probabilities = [score["probability"] for score in found["scores"]]
    assert probabilities == sorted(probabilities, reverse=True)
    assert sum(probabilities) == pytest.approx(1, abs=1e-4)
    assert {score["class"] for score in found["scores"]} == {"ball", "box", "ring"}
    for score in found["scores"]:
        exact = float(result.scores[result.classes.index(score["class"])])
        assert score["score"] == pytest.approx(exact, abs=1e-5)
    assert found["model"] == {"name": "tiny", "sha256": classifier.model.sha256}
    assert found["mesh"]["faces_in"] == result.report.faces_in


@pytest.mark.parametrize(("top", "count"), [(1, 1), (2, 2), (3, 3), (99, 3), (None, 3)])
def test_top_keeps_the_likeliest(
    classifier: Classifier, result: Prediction, top: int | None, count: int
) -> None:
    all_scores = answer(None, result).scores
    assert answer(None, result, top).scores == all_scores[:count]


def test_a_refusal_holds_the_fault_and_the_reason() -> None:
    failure = Failure.of(UnusableMesh("no-faces", "the file holds no triangles"))
    assert json.loads(to_json(record("a.obj", failure))) == {
        "file": "a.obj",
        "error": {"fault": "no-faces", "message": "the file holds no triangles"},
    }


def test_a_file_that_cannot_be_opened_is_a_refusal() -> None:
    error = PermissionError(errno.EACCES, os.strerror(errno.EACCES), "/secret/a.obj")
    failure = Failure.of(error)
    assert failure.fault == "unreadable"
    assert failure.message == f"cannot be opened: {os.strerror(errno.EACCES)}"


def test_names_become_text_whatever_the_file_system_writes(monkeypatch: pytest.MonkeyPatch) -> None:
    """An archive's member may be called what the file system's encoding lacks."""
    monkeypatch.setattr(os, "fsencode", lambda name: name.encode("ascii", "surrogateescape"))
    assert readable("a.zip/\u00fcn\u00ef.ply") == "a.zip/\u00fcn\u00ef.ply"
    assert readable("\udcff.obj") == "\ufffd.obj"
