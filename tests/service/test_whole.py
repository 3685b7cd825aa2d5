"""A whole-pipeline file serves as the model file that it was made from."""

from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner

from meshconv3d.export.teaching import Examples, Teacher
from meshconv3d.model.loading import load_mesh
from meshconv3d.model.samples import sample_paths
from meshconv3d.service.attribution import explain
from meshconv3d.service.classifier import Classifier
from meshconv3d.service.cli.main import commands
from meshconv3d.service.models import open_model
from tests.conftest import exported

SAMPLES = list(sample_paths().values())


@pytest.fixture(scope="module")
def model(model_file: Path) -> Classifier:
    return Classifier.load(model_file)


@pytest.fixture(scope="module")
def whole(whole_file: Path) -> Classifier:
    return Classifier.load(whole_file)


@pytest.mark.parametrize("path", SAMPLES, ids=lambda path: path.stem)
def test_answers_are_those_of_the_model_file(
    model: Classifier, whole: Classifier, path: Path
) -> None:
    one, other = model.classify(path), whole.classify(path)
    for name in ("scores", "probabilities", "embedding", "novelty"):
        expected = np.asarray(getattr(one, name))
        scale = max(1.0, float(np.abs(expected).max()))
        np.testing.assert_allclose(getattr(other, name), expected, atol=1e-4 * scale, err_msg=name)
    assert (other.label, other.unknown, other.space) == (one.label, one.unknown, one.space)


def test_explanations_are_those_of_the_model_file(model: Classifier, whole: Classifier) -> None:
    one, other = (explain(each, SAMPLES[0], label="ring") for each in (model, whole))
    assert other.contributions == pytest.approx(one.contributions, abs=1e-5)
    assert other.bias == pytest.approx(one.bias, abs=1e-4)


def test_what_is_taught_on_it_is_a_whole_pipeline(model_file: Path, whole_file: Path) -> None:
    found = []
    for path in (model_file, whole_file):
        teacher = Teacher(path.read_bytes())
        meshes = [load_mesh(path) for path in SAMPLES[:4]]
        features = [teacher.features(mesh) for mesh in meshes]
        examples = Examples.of(["a", "b", "a", "b"], ["1", "2", "3", "4"], features)
        taught = teacher.teach("mine", examples, (SAMPLES[0].stem, meshes[0]))
        again = Teacher(taught.content)
        assert again.examples is not None
        found.append((features, taught.card.space, np.array(taught.card.probe.scores)))
    (features, space, scores), (whole_features, whole_space, whole_scores) = found
    np.testing.assert_allclose(whole_features, features, atol=1e-4)
    assert whole_space == space
    assert whole_scores == pytest.approx(scores, abs=1e-3)


def test_learned_pooling_is_taught_and_classified(learned_file: Path, tmp_path: Path) -> None:
    teacher = Teacher(learned_file.read_bytes())
    meshes = [load_mesh(path) for path in SAMPLES[:2]]
    examples = Examples.of(["a", "b"], ["1", "2"], [teacher.features(mesh) for mesh in meshes])
    taught = teacher.teach("mine", examples, (SAMPLES[0].stem, meshes[0]))
    path = tmp_path / "mine.onnx"
    path.write_bytes(taught.content)
    classifier = Classifier.load(path)
    assert [classifier.classify(mesh).label for mesh in meshes] == ["a", "b"]


def test_inspect_and_verify_read_it(
    whole_file: Path, learned_file: Path, checkpoint_file: Path
) -> None:
    for path in (whole_file, learned_file):
        result = CliRunner().invoke(commands, ["inspect", str(path), "--json"])
        assert result.exit_code == 0, result.output
    verify = ["verify", "--checkpoint", str(checkpoint_file)]
    result = CliRunner().invoke(commands, [*verify, str(whole_file)])
    assert result.exit_code == 0, result.output
    result = CliRunner().invoke(commands, [*verify, str(learned_file)])
    assert result.exit_code == 1
    assert "does not compute what the checkpoint does" in result.stderr


def test_a_shipped_name_is_made_whole_without_torch(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """From its model file, whose card it keeps."""
    monkeypatch.setattr("meshconv3d.model.nn.checkpoint.load_checkpoint", None)
    path = exported(Path("shrec11"), tmp_path / "mine.onnx", "--whole")
    made, shipped = open_model(str(path)).card, open_model("shrec11").card
    assert (made.name, made.about, made.space) == (shipped.name, shipped.about, shipped.space)
