"""`meshconv3d teach`: from folders of examples to a model that every command takes."""

import json
from pathlib import Path

import numpy as np
import pytest

from meshconv3d.model.mesh import Mesh
from tests.commands import meshconv3d
from tests.meshes import cube, icosphere, torus, write_off


@pytest.fixture(scope="module")
def examples(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Six stretched copies of three solids, a test mesh of each, and a file that is no mesh."""
    folder = tmp_path_factory.mktemp("examples")
    rng = np.random.default_rng(0)
    for name, mesh in (("ball", icosphere(2)), ("box", cube()), ("ring", torus())):
        for split in ("train", "test"):
            (folder / name / split).mkdir(parents=True)
        for number in range(7):
            stretched = Mesh(mesh.vertices * rng.uniform(0.8, 1.2, 3), mesh.faces)
            place = folder / name / ("test" if number == 6 else "train") / f"{number}.off"
            write_off(place, stretched)
    (folder / "ring" / "train" / "broken.stl").write_bytes(b"solid nothing")
    return folder


@pytest.fixture(scope="module")
def taught(examples: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    return teach(examples, tmp_path_factory.mktemp("model") / "mine.onnx")


def teach(examples: Path, file: Path, *more: object) -> Path:
    done = meshconv3d("teach", examples, "-o", file, *more)
    assert done.returncode == 0, done.stderr
    assert "broken.stl is left out" in done.stderr
    assert "of 18 examples, each left out in turn" in done.stdout
    return file


def test_the_model_knows_the_classes_of_the_folders(examples: Path, taught: Path) -> None:
    files = sorted(examples.glob("*/test/*.off"))
    done = meshconv3d("classify", *files, "--model", taught)
    answers = [json.loads(line) for line in done.stdout.splitlines()]
    assert [a["class"] for a in answers] == [file.parts[-3] for file in files]
    assert all(a["model"]["name"] == "mine" for a in answers)


def test_evidence_is_explained(examples: Path, taught: Path, tmp_path: Path) -> None:
    mesh = next(examples.glob("ring/test/*.off"))
    done = meshconv3d("explain", mesh, "-o", tmp_path / "why.glb", "--model", taught)
    assert done.returncode == 0, done.stderr


def test_more_can_be_added(examples: Path, taught: Path, tmp_path: Path) -> None:
    (tmp_path / "more" / "cone").mkdir(parents=True)
    (tmp_path / "more" / "ball").mkdir()
    ball = icosphere(2)
    for number in range(3):
        cone = Mesh(ball.vertices * (1, 1 + number / 4, 0.1), ball.faces)
        write_off(tmp_path / "more" / "cone" / f"{number}.off", cone)
    write_off(tmp_path / "more" / "ball" / "another.off", ball)
    file = tmp_path / "both.onnx"
    done = meshconv3d("teach", tmp_path / "more", "-o", file, "--add", taught)
    assert done.returncode == 0, done.stderr
    assert "  cone: 3" in done.stdout  # fewer than enough
    card = json.loads(meshconv3d("inspect", file, "--json").stdout)
    counts = card["training"]["taught"]["examples"]
    assert counts == {"ball": 7, "box": 6, "cone": 3, "ring": 6}


def test_an_interrupted_or_wrong_call_writes_nothing(
    examples: Path, taught: Path, tmp_path: Path
) -> None:
    file = tmp_path / "none.onnx"
    (tmp_path / "empty").mkdir()
    alone = tmp_path / "alone"
    (alone / "box").mkdir(parents=True)
    write_off(alone / "box" / "one.off", cube())
    reserved = tmp_path / "reserved"
    (reserved / "unknown").mkdir(parents=True)
    write_off(reserved / "unknown" / "one.off", cube())
    for arguments, reason in (
        ((alone,), "two classes or more"),
        ((tmp_path / "empty", "--add", taught), "has no example to add"),
        ((examples, "-o", tmp_path / "mesh.stl"), "does not end with .onnx"),
        ((examples, "--add", examples / "ball" / "train" / "0.off"), "damaged or is no ONNX"),
        ((examples, "--base", "nothing"), "no model 'nothing'"),
        ((reserved,), "no class may be called unknown"),
        (
            (examples, "--base", "objects", "--add", examples / "ball" / "train" / "0.off"),
            "leave --base out",
        ),
    ):
        done = meshconv3d("teach", "-o", file, *arguments)
        assert done.returncode == 2
        assert reason in done.stderr
    assert not file.exists()
    assert not (tmp_path / "mesh.stl").exists()
