"""A folder laid out as Manifold40 is, which itself cannot be had here, through the whole round.

Manifold40/CLASS/{train,test}/CLASS_0001.obj, as published with SubdivNet: 40 classes, some with
an underscore in their name, closed meshes of about 500 faces.
"""

import json
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner

from meshconv3d.model.datasets import class_names, find_samples
from meshconv3d.model.mesh import Mesh
from meshconv3d.model.training.variation import with_faces
from meshconv3d.service.cli.main import commands
from tests.meshes import cube, icosphere, torus

SHAPES = {"airplane": torus(), "flower_pot": icosphere(2), "night_stand": cube()}
FACES = (500, 498, 412, 1000)


def write_obj(path: Path, mesh: Mesh) -> None:
    path.parent.mkdir(parents=True, exist_ok=True)
    lines = ["v {:.6f} {:.6f} {:.6f}".format(*point) for point in mesh.vertices.tolist()]
    lines += ["f {} {} {}".format(*face) for face in (mesh.faces + 1).tolist()]
    path.write_text("\n".join(lines) + "\n")


@pytest.fixture(scope="module")
def manifold40(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Three of its classes, four meshes of each to train on and two to test on."""
    root = tmp_path_factory.mktemp("data") / "Manifold40"
    rng = np.random.default_rng(0)
    for label, shape in SHAPES.items():
        for number in range(1, 7):
            mesh = with_faces(shape, FACES[number % len(FACES)])
            stretched = mesh.moved(mesh.vertices * rng.uniform(0.7, 1.4, 3))
            split = "train" if number <= 4 else "test"
            write_obj(root / label / split / f"{label}_{number:04d}.obj", stretched)
    return root


def run(*arguments: object) -> str:
    """What a command that succeeds prints."""
    result = CliRunner().invoke(commands, [str(argument) for argument in arguments])
    assert result.exit_code == 0, result.output
    return result.stdout


def test_its_layout_is_read_as_it_is(manifold40):
    samples = find_samples(manifold40)
    assert class_names(samples) == ("airplane", "flower_pot", "night_stand")
    assert [(s.path.name, s.label, s.split) for s in samples[-6:]] == [
        ("night_stand_0005.obj", "night_stand", "test"),
        ("night_stand_0006.obj", "night_stand", "test"),
        ("night_stand_0001.obj", "night_stand", "train"),
        ("night_stand_0002.obj", "night_stand", "train"),
        ("night_stand_0003.obj", "night_stand", "train"),
        ("night_stand_0004.obj", "night_stand", "train"),
    ]


def test_it_is_trained_on_exported_and_evaluated(manifold40, tmp_path):
    train = ["train", manifold40, "--out", tmp_path, "--set", "channels=[32,64,128]"]
    said = run(*train, "--epochs", 1, "--batch-size", 4, "--copies", 0)
    assert "of 6 meshes" in said
    model = tmp_path / "manifold40.onnx"
    run("export", tmp_path / "model.safetensors", "-o", model)
    report = json.loads(run("evaluate", model, manifold40))
    assert (report["files"], report["refused"]) == (6, 0)
    assert [row["class"] for row in report["classes"]] == list(SHAPES)
