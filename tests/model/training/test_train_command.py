"""`meshconv3d train` as it is called: what it begins with, and what it refuses."""

from pathlib import Path

import pytest
from click.testing import CliRunner, Result

from meshconv3d.model.mesh import Mesh
from meshconv3d.model.nn.checkpoint import load_checkpoint
from meshconv3d.service.cli.main import commands
from tests.meshes import cube, icosphere, torus

BALLS = {"ball": icosphere(2), "box": cube()}
RINGS = {"box": cube(), "ring": torus(), "tube": torus(30, 6)}


def write(folder: Path, shapes: dict[str, Mesh]) -> Path:
    """Four meshes of each class to train on, and one to test on."""
    for label, mesh in shapes.items():
        for number in range(5):
            path = folder / label / ("train" if number else "test") / f"{number}.off"
            path.parent.mkdir(parents=True, exist_ok=True)
            rows = [f"{x} {y} {z + number / 10 * z}" for x, y, z in mesh.vertices.tolist()]
            rows += [f"3 {a} {b} {c}" for a, b, c in mesh.faces.tolist()]
            path.write_text("\n".join([f"OFF {len(mesh.vertices)} {len(mesh.faces)} 0", *rows, ""]))
    return folder


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
    result = train(data, tmp_path / "run", "--from", first)
    assert result.exit_code == 0, result.output
    before, after = load_checkpoint(first), load_checkpoint(tmp_path / "run" / "model.safetensors")
    assert after.network.config.channels == (8, 8, 8)
    assert after.network.config.classes == tuple(RINGS)
    assert after.training["from"] == before.training
    assert "already finished" in train(data, tmp_path / "run", "--from", first).stderr
    other = train(data, tmp_path / "run", "--set", "channels=[8,8,8]")
    assert other.exit_code == 2
    assert "other settings or data" in other.stderr


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
