"""`meshconv3d train` as it is called: what it begins with, and what it refuses."""

import errno
import os
from dataclasses import fields
from pathlib import Path

import pytest
import torch
from click.testing import CliRunner, Result

from meshconv3d.model.checkpoints import shipped_checkpoints
from meshconv3d.model.config import NetworkConfig
from meshconv3d.model.mesh import Mesh
from meshconv3d.model.nn.checkpoint import load_checkpoint
from meshconv3d.service.cli.main import commands
from tests.meshes import cube, icosphere, torus, write_off

BALLS = {"ball": icosphere(2), "box": cube()}
RINGS = {"box": cube(), "ring": torus(), "tube": torus(30, 6)}


def write(folder: Path, shapes: dict[str, Mesh], layout: str = "", count: int = 5) -> Path:
    """`count` meshes of each class: one to test on, the others to train on, or as in `layout`."""
    for label, mesh in shapes.items():
        for number in range(count):
            split = layout or ("train" if number else "test")
            grown = mesh.moved(mesh.vertices * [1, 1, 1 + number / 10])
            write_off(folder / label / split / f"{number}.off", grown)
    return folder


SMALL = ("--set", "channels=[8,8,8]")


def train(data: Path, out: Path, *options: object) -> Result:
    quick = ["--epochs", 1, "--batch-size", 4, "--copies", 0, "--hold-out", 0]
    call = ["train", data, "--out", out, *quick, *options]
    return CliRunner().invoke(commands, [str(argument) for argument in call])


@pytest.fixture(scope="module")
def first(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A checkpoint of balls and boxes."""
    folder = tmp_path_factory.mktemp("first")
    result = train(write(folder / "data", BALLS), folder, "--set", "channels=[8,8,8]")
    assert result.exit_code == 0, result.output
    return folder / "model.safetensors"


def test_a_run_begins_with_the_network_of_another(first: Path, tmp_path: Path) -> None:
    data = write(tmp_path / "data", RINGS)
    adapt = ("--from", first, "--learning-rate", 1e-4)
    result = train(data, tmp_path / "run", *adapt)
    assert result.exit_code == 0, result.output
    before, after = load_checkpoint(first), load_checkpoint(tmp_path / "run" / "model.safetensors")
    assert after.network.config.channels == (8, 8, 8)
    assert after.network.config.classes == tuple(RINGS)
    assert after.training["from"] == before.training
    assert after.training["protocol"]["learning_rate"] == 1e-4
    assert "already finished" in train(data, tmp_path / "run", *adapt).stderr
    other = train(data, tmp_path / "run", "--set", "channels=[8,8,8]")
    assert other.exit_code == 2
    assert "other settings or data" in other.stderr


def test_a_run_begins_with_a_shipped_model_by_name(tmp_path: Path) -> None:
    data = write(tmp_path / "data", RINGS)
    result = train(data, tmp_path / "run", "--from", "shrec11", "--epochs", 1, "--copies", 0)
    assert result.exit_code == 0, result.output
    after = load_checkpoint(tmp_path / "run" / "model.safetensors")
    assert after.training["from"] == load_checkpoint(shipped_checkpoints()["shrec11"]).training
    missing = train(data, tmp_path / "other", "--from", "shrec12")
    assert missing.exit_code == 2
    assert "Shipped models are objects, parts, shrec11." in missing.stderr


@pytest.mark.parametrize("options", [("--preset", "default"), ("--set", "patch_size=4")])
def test_a_network_is_named_once(first: Path, tmp_path: Path, options: tuple[str, ...]) -> None:
    result = train(first.parent / "data", tmp_path / "run", "--from", first, *options)
    assert result.exit_code == 2
    assert "leave --preset and --set out" in result.stderr


def test_what_is_no_checkpoint_is_refused(first: Path, tmp_path: Path) -> None:
    resume = first.with_name("resume.safetensors")
    result = train(first.parent / "data", tmp_path / "run", "--from", resume)
    assert result.exit_code == 2
    assert "is not a meshconv3d checkpoint" in result.stderr
    assert not (tmp_path / "run").exists()


def test_every_class_needs_a_mesh_that_can_be_used(tmp_path: Path) -> None:
    data = write(tmp_path / "data", RINGS)
    for path in (data / "ring" / "train").iterdir():
        path.write_text("nothing")
    result = train(data, tmp_path / "out", "--set", "channels=[8,8,8]")
    assert result.exit_code == 2
    assert "no training mesh can be used of: ring" in result.output
    assert not (tmp_path / "out" / "model.safetensors").exists()


def test_classes_are_not_a_setting(tmp_path: Path) -> None:
    data = write(tmp_path / "data", BALLS)
    result = train(data, tmp_path / "out", "--set", 'classes=["a","b"]')
    assert result.exit_code == 2
    assert "classes: they are those of the data" in result.output


def said(result: Result) -> str:
    assert result.exit_code == 0, result.output
    return result.stderr


def data_of(out: Path) -> dict:
    return load_checkpoint(out / "model.safetensors").training["data"]


def test_validation_files_that_cannot_be_read_are_no_validation(tmp_path: Path) -> None:
    data = write(tmp_path / "data", BALLS)
    for label in BALLS:
        (data / label / "val").mkdir()
        (data / label / "val" / "0.off").write_text("nothing")
    stderr = said(train(data, tmp_path / "none", *SMALL))
    assert "not calibrated" in stderr
    assert load_checkpoint(tmp_path / "none" / "model.safetensors").calibration is None
    stderr = said(train(data, tmp_path / "held", *SMALL, "--hold-out", 0.25))
    assert "2 training meshes are held out" in stderr
    calibration = load_checkpoint(tmp_path / "held" / "model.safetensors").calibration
    assert calibration is not None
    assert calibration.meshes == 2


@pytest.mark.parametrize("seed", range(3))
def test_meshes_are_held_out_among_those_that_can_be_read(tmp_path: Path, seed: int) -> None:
    data = write(tmp_path / "data", BALLS)
    for label in BALLS:
        for number in range(10, 20):
            (data / label / "train" / f"{number}.off").write_text("nothing")
    said(train(data, tmp_path, *SMALL, "--hold-out", 0.5, "--seed", seed))
    calibration = load_checkpoint(tmp_path / "model.safetensors").calibration
    assert calibration is not None
    assert calibration.meshes == 4


def test_a_folder_without_splits_is_trained_on(tmp_path: Path) -> None:
    data = write(tmp_path / "data", BALLS, layout=".", count=8)
    stderr = said(train(data, tmp_path / "run", *SMALL, "--hold-out", 0.125))
    assert "training meshes alone" in stderr
    assert "2 training meshes are held out" in stderr
    found = data_of(tmp_path / "run")
    assert (found["train"], found["val"], found["test"]) == (14, 2, 0)


def test_a_random_split_is_written_down(tmp_path: Path) -> None:
    data = write(tmp_path / "data", BALLS, layout=".")
    split = ("--split", "random:3", "--seed", 4)
    stderr = said(train(data, tmp_path / "one", *SMALL, *split))
    assert "6 train, 0 val, 4 test meshes" in stderr
    assert data_of(tmp_path / "one")["split"] == "random:3"
    table = tmp_path / "one" / "split.csv"
    said(train(data, tmp_path / "two", *SMALL, "--split", table, "--seed", 4))
    one, two = (load_checkpoint(tmp_path / run / "model.safetensors") for run in ("one", "two"))
    for name, tensor in one.network.state_dict().items():
        assert torch.equal(tensor, two.network.state_dict()[name])
    result = train(data, tmp_path / "three", *SMALL, "--split", "random:5")
    assert (result.exit_code, "leave none to test on" in result.stderr) == (2, True)


def test_a_set_smaller_than_a_batch_is_trained_on_in_smaller_ones(tmp_path: Path) -> None:
    data = write(tmp_path / "data", BALLS, count=7)
    stderr = said(train(data, tmp_path / "run", *SMALL, "--batch-size", 16))
    assert "12 training meshes: batches of 3" in stderr
    training = load_checkpoint(tmp_path / "run" / "model.safetensors").training
    assert training["protocol"]["batch_size"] == 3


def test_without_a_terminal_every_epoch_is_a_line(first: Path, tmp_path: Path) -> None:
    stderr = said(train(first.parent / "data", tmp_path, *SMALL, "--epochs", 3))
    lines = [line for line in stderr.splitlines() if line.startswith("epoch ")]
    assert [line.partition(":")[0] for line in lines] == [f"epoch {i} of 3" for i in (1, 2, 3)]
    assert "loss" in lines[0]


@pytest.mark.parametrize("name", ["resume.safetensors", "log.jsonl", "model.safetensors"])
def test_a_full_disk_loses_no_finished_epoch(
    first: Path, tmp_path: Path, name: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    data, options = first.parent / "data", (*SMALL, "--epochs", 2)
    rename, left = os.replace, [2]

    def fill_up(new: str, path: Path) -> None:
        if path.name == name:
            left[0] -= 1
            if left[0] <= (0 if name != "model.safetensors" else 1):
                raise OSError(errno.ENOSPC, "No space left on device")
        rename(new, path)

    with monkeypatch.context() as patch:
        patch.setattr(os, "replace", fill_up)
        result = train(data, tmp_path, *options)
    assert result.exit_code == 1
    assert "run the same command again to go on after" in result.stderr
    assert "No space left on device" in result.stderr
    assert not list(tmp_path.glob(".meshconv3d-*"))
    stderr = said(train(data, tmp_path, *options))
    assert "going on after epoch 1" in stderr or "already finished" in stderr
    assert (tmp_path / "model.safetensors").is_file()


def test_the_settings_are_listed_without_data() -> None:
    result = CliRunner().invoke(commands, ["train", "--settings"])
    assert result.exit_code == 0
    for field in fields(NetworkConfig)[1:]:
        assert f"{field.name}=" in result.output
    assert "[paper 11]" in result.output
