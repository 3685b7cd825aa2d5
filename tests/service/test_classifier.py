"""The classifier: one answer, however the mesh comes and whoever else asks."""

import dataclasses
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import numpy as np
import pytest

from meshconv3d.export.metadata import Probe
from meshconv3d.model.errors import MeshError
from meshconv3d.model.loading import load_mesh
from meshconv3d.service import classifier as classifier_module
from meshconv3d.service.classifier import Classifier, SelfTestError, slow_start_told
from meshconv3d.service.models import Model
from tests.articulated import sample_paths
from tests.processes import until


@pytest.fixture(scope="module")
def classifier(model_file: Path) -> Classifier:
    return Classifier.load(str(model_file))


def test_path_and_bytes_are_one_mesh(classifier: Classifier) -> None:
    for name, path in sample_paths().items():
        by_path = classifier.classify(path)
        by_text = classifier.classify(str(path))
        by_bytes = classifier.classify(path.read_bytes(), path.name)
        by_content = classifier.classify(path.read_bytes())
        for other in (by_text, by_bytes, by_content):
            assert np.array_equal(other.scores, by_path.scores), name
            assert other.report == by_path.report


def test_many_threads_score_as_one(classifier: Classifier) -> None:
    paths = list(sample_paths().values())
    alone = [classifier.classify(path).scores for path in paths]
    assert len({tuple(scores) for scores in alone}) == len(paths)
    with ThreadPoolExecutor(8) as pool:
        at_once = list(pool.map(classifier.classify, paths * 6))
    for i, result in enumerate(at_once):
        np.testing.assert_allclose(result.scores, alone[i % len(paths)], rtol=1e-5, atol=1e-5)


def test_an_answer_is_consistent(classifier: Classifier) -> None:
    result = classifier.classify(sample_paths()["ants"])
    assert result.classes == ("ball", "box", "ring")
    assert result.probabilities.sum() == pytest.approx(1)
    likeliest = result.top()
    assert {one.name for one in likeliest} == set(result.classes)
    assert [one.probability for one in likeliest] == sorted(result.probabilities)[::-1]
    assert result.label == result.classes[int(result.scores.argmax())] == likeliest[0].name
    assert list(result.timings_ms) == ["read", "prepare", "topology", "infer"]


def test_a_mesh_in_memory_scores_like_its_file(classifier: Classifier) -> None:
    path = sample_paths()["ants"]
    of_mesh = classifier.classify(load_mesh(path))
    assert of_mesh.scores.tolist() == classifier.classify(path).scores.tolist()
    assert list(of_mesh.timings_ms) == ["prepare", "topology", "infer"]


def test_bad_input_raises_what_is_documented(classifier: Classifier, tmp_path: Path) -> None:
    with pytest.raises(MeshError):
        classifier.classify(b"")
    with pytest.raises(MeshError, match=r"nothing.obj.*cannot be opened") as error:
        classifier.classify(tmp_path / "nothing.obj")
    assert error.value.fault == "unreadable"


def test_the_self_test_passes_on_the_file_as_exported(classifier: Classifier) -> None:
    classifier.self_test()


@pytest.mark.parametrize("change", [-0.05, 0.05, float("nan")])
def test_the_self_test_fails_where_scores_differ(classifier: Classifier, change: float) -> None:
    probe = classifier.model.card.probe
    first, *others = probe.scores
    changed = (first + change * max(probe.scores, key=abs), *others)
    with pytest.raises(SelfTestError, match=f"model tiny scores the sample {probe.sample}"):
        Classifier(with_probe(classifier.model, Probe(probe.sample, changed))).self_test()


@pytest.mark.parametrize("sample", ["laptop", "unheard of"])
def test_the_self_test_fails_on_another_sample(classifier: Classifier, sample: str) -> None:
    probe = Probe(sample, classifier.model.card.probe.scores)
    with pytest.raises(SelfTestError, match=f"model tiny.*{sample}"):
        Classifier(with_probe(classifier.model, probe)).self_test()


def with_probe(model: Model, probe: Probe) -> Model:
    return dataclasses.replace(model, card=dataclasses.replace(model.card, probe=probe))


def test_a_slow_start_is_told(monkeypatch: pytest.MonkeyPatch) -> None:
    told: list[str] = []
    with slow_start_told(told.append):
        pass
    monkeypatch.setattr(classifier_module, "PATIENCE_SECONDS", 0.01)
    with slow_start_told(told.append):
        until(lambda: told != [])
    assert len(told) == 1
    assert "kernels" in told[0]
