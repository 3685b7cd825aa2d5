"""`meshconv3d export`, `verify` and `inspect` from end to end."""

import json
import math
from pathlib import Path

import onnx
import pytest
from click.testing import CliRunner, Result

from meshconv3d.export.metadata import PREFIX
from meshconv3d.model import samples
from meshconv3d.model.config import NetworkConfig
from meshconv3d.model.nn.checkpoint import Checkpoint, load_checkpoint, save_checkpoint
from meshconv3d.service.cli.main import commands
from tests.articulated import sample_paths
from tests.networks import untrained


def run(*arguments: object) -> Result:
    result = CliRunner().invoke(commands, [str(argument) for argument in arguments])
    assert result.exception is None or isinstance(result.exception, SystemExit), result.exception
    return result


@pytest.fixture(scope="module")
def other_checkpoint(checkpoint_file: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Of the same shape, with other weights."""
    config = load_checkpoint(checkpoint_file).network.config
    path = tmp_path_factory.mktemp("other") / "other.safetensors"
    save_checkpoint(Checkpoint(untrained(config, seed=1)), path)
    return path


def test_export_names_the_model_and_tells_its_parity(checkpoint_file: Path, tmp_path: Path) -> None:
    about = "# Things\n\nBalls, boxes and rings, naïvely. \x1b]0;boxes\n"
    (tmp_path / "card.md").write_text(about, encoding="utf-8")
    path = tmp_path / "file.onnx"
    mesh = sample_paths()["ants"]
    options = ("--name", "things", "--mesh", mesh, "--card", tmp_path / "card.md")
    result = run("export", checkpoint_file, "-o", path, *options)
    assert result.exit_code == 0
    assert str(path) in result.stdout
    card = json.loads(run("inspect", path, "--json").stdout)
    assert card["name"] == "things"
    assert card["parity"]["meshes"] == len(samples.sample_paths()) + 1
    assert card["accuracy"] == {"test": 0.25}
    assert card["training"] == {"data": {"name": "none"}}
    assert card["probe"]["sample"] in samples.sample_paths()
    assert sorted(file.name for file in tmp_path.iterdir()) == ["card.md", "file.onnx"]
    # What people should know is in the file, and does not command the terminal.
    assert card["about"] == about
    assert run("inspect", path).stdout.startswith(about.replace("\x1b", "\ufffd"))


def test_export_to_a_missing_folder_is_a_usage_error(checkpoint_file: Path, tmp_path: Path) -> None:
    result = run("export", checkpoint_file, "-o", tmp_path / "no" / "file.onnx")
    assert result.exit_code == 2
    assert "no such folder" in result.stderr


def test_export_of_what_is_no_checkpoint_fails(model_file: Path, tmp_path: Path) -> None:
    text = tmp_path / "notes.safetensors"
    text.write_text("no checkpoint")
    result = run("export", text, "-o", tmp_path / "file.onnx")
    assert result.exit_code == 1
    assert f"{text} is not a safetensors file" in result.stderr
    result = run("export", model_file, "-o", tmp_path / "file.onnx")
    assert result.exit_code == 2
    assert "with --whole it becomes a whole pipeline" in result.stderr
    assert list(tmp_path.iterdir()) == [text]


@pytest.mark.parametrize("name", ["mesh.stl", "model"])
def test_export_writes_no_file_of_another_form(
    name: str, checkpoint_file: Path, tmp_path: Path
) -> None:
    (tmp_path / "mesh.stl").write_text("solid")
    result = run("export", checkpoint_file, "-o", tmp_path / name)
    assert result.exit_code == 2
    assert f"{name} does not end with .onnx" in result.stderr
    assert (tmp_path / "mesh.stl").read_text() == "solid"


def test_export_refuses_a_mesh_that_cannot_be_compared_on(
    checkpoint_file: Path, tmp_path: Path
) -> None:
    mesh = tmp_path / "points.obj"
    mesh.write_text("v 0 0 0\n")
    result = run("export", checkpoint_file, "-o", tmp_path / "file.onnx", "--mesh", mesh)
    assert result.exit_code == 1
    assert str(mesh) in result.stderr
    assert "no triangles" in result.stderr
    assert list(tmp_path.iterdir()) == [mesh]


def test_verify_agrees_with_the_own_checkpoint(model_file: Path, checkpoint_file: Path) -> None:
    result = run("verify", model_file, "--checkpoint", checkpoint_file)
    assert result.exit_code == 0
    assert f"{model_file} agrees with {checkpoint_file.name}" in result.stdout


def test_verify_fails_on_other_weights(model_file: Path, other_checkpoint: Path) -> None:
    result = run("verify", model_file, "--checkpoint", other_checkpoint)
    assert result.exit_code == 1
    assert "does not compute what the checkpoint does" in result.stderr


def test_verify_fails_on_another_shape(model_file: Path, tmp_path: Path) -> None:
    config = NetworkConfig(classes=("a", "b"), channels=(4,), targets=(200,))
    path = tmp_path / "shallow.safetensors"
    save_checkpoint(Checkpoint(untrained(config)), path)
    result = run("verify", model_file, "--checkpoint", path)
    assert result.exit_code == 1
    assert "inputs are" in result.stderr


@pytest.mark.parametrize(
    ("name", "change", "says"),
    [
        (
            "config",
            {"classes": ["box", "ball", "ring"]},
            "config.classes on its card is ('box',",
        ),
        ("calibration", {"temperature": 19.0}, "calibration.temperature on its card is 19.0"),
        ("calibration", None, "calibration on its card is None"),
        ("probe", {"scores": [9.0, 9.0, 9.0]}, "its probe has the scores"),
        ("probe", {"scores": [math.nan] * 3}, "its probe has the scores"),
        ("accuracy", {"test": 1.0}, "accuracy.test on its card is 1.0, in the checkpoint 0.25"),
        (
            "training",
            {"data": {"name": "other"}},
            "training.data.name on its card is other",
        ),
        ("parity", {"scores": 0.01}, "parity on its card is {'scores': 0.01"),
        ("space", "other", "space on its card is other"),
        ("probe", {"sample": "cup"}, "'cup', which is no sample"),
    ],
)
def test_verify_fails_when_the_card_says_something_else(
    model_file: Path, checkpoint_file: Path, tmp_path: Path, name: str, change: object, says: str
) -> None:
    """The graph alone cannot tell: its scores have no names."""
    graph = onnx.load(model_file)
    (entry,) = (entry for entry in graph.metadata_props if entry.key == PREFIX + name)
    value = json.loads(entry.value)
    entry.value = json.dumps(value | change if isinstance(change, dict) else change)
    path = tmp_path / "changed.onnx"
    path.write_bytes(graph.SerializeToString())
    result = run("verify", path, "--checkpoint", checkpoint_file)
    assert result.exit_code == 1
    assert says in result.stderr


def test_verify_fails_on_what_is_no_model(checkpoint_file: Path) -> None:
    result = run("verify", checkpoint_file, "--checkpoint", checkpoint_file)
    assert result.exit_code == 1
    assert "the file is a checkpoint" in result.stderr


def test_inspect_shows_every_entry_for_people_and_programs(model_file: Path) -> None:
    card = json.loads(run("inspect", model_file, "--json").stdout)
    text = run("inspect", model_file).stdout
    assert card.pop("about") == ""
    for name, value in card.items():
        assert f"{name}:" in text
        for key in value if isinstance(value, dict) else ():
            assert f"  {key}:" in text
    assert "ball, box, ring" in text
    assert card["sha256"] in text


def test_a_card_that_is_no_text_is_a_usage_error(checkpoint_file: Path, tmp_path: Path) -> None:
    (tmp_path / "card.md").write_bytes(b"\xff\xfe")
    result = run(
        "export", checkpoint_file, "-o", tmp_path / "a.onnx", "--card", tmp_path / "card.md"
    )
    assert result.exit_code == 2
    assert "card.md is not UTF-8 text" in result.stderr


def test_inspect_of_an_unknown_model_is_a_usage_error() -> None:
    result = run("inspect", "nothing")
    assert result.exit_code == 2
    assert "no model 'nothing'" in result.stderr
