"""`import meshconv3d` as users have it: names, kinds of input, errors, and the reference."""

import re
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
import trimesh

import meshconv3d
from docs.reference import PAGES
from meshconv3d.model.loading import load_mesh
from tests.articulated import sample_paths
from tests.commands import environment

ROOT = Path(__file__).parents[1]
HAND = sample_paths()["hand"]


@pytest.fixture(scope="module")
def shrec11() -> meshconv3d.Classifier:
    return meshconv3d.load("shrec11")


def run(program: str, folder: Path) -> list[str]:
    done = subprocess.run(
        [sys.executable, "-c", program],
        cwd=folder,
        env=environment() | {"PYTHONPATH": str(ROOT)},
        capture_output=True,
        text=True,
        timeout=120,
    )
    assert done.returncode == 0, done.stderr
    return done.stdout.splitlines()


def test_it_works_beside_modules_of_the_users_that_have_the_folders_names(tmp_path: Path) -> None:
    for name in ("model.py", "export.py", "service/__init__.py"):
        path = tmp_path / name
        path.parent.mkdir(exist_ok=True)
        path.write_text("raise ImportError('this file is the user\\'s')")
    (tmp_path / "x.stl").write_bytes(HAND.read_bytes())
    program = "import meshconv3d; print(meshconv3d.load('shrec11').classify('x.stl').label)"
    assert run(program, tmp_path) == ["hand"]


def test_the_import_loads_no_library(tmp_path: Path) -> None:
    program = "import sys, meshconv3d; print(*{name.partition('.')[0] for name in sys.modules})"
    [loaded] = run(program, tmp_path)
    assert {"numpy", "numba", "onnxruntime", "pydantic"}.isdisjoint(loaded.split())


def test_every_name_is_there() -> None:
    for name in meshconv3d.__all__:
        assert getattr(meshconv3d, name).__name__ == name
    with pytest.raises(AttributeError, match="no attribute 'nothing'"):
        meshconv3d.nothing  # noqa: B018 (the look-up is the test)


def test_all_kinds_of_input_are_one_mesh(shrec11: meshconv3d.Classifier) -> None:
    mesh = load_mesh(HAND)
    of_trimesh = trimesh.Trimesh(mesh.vertices, mesh.faces, process=False)
    kinds = [
        str(HAND),
        HAND.read_bytes(),
        (mesh.vertices, mesh.faces),
        (mesh.vertices.tolist(), mesh.faces.tolist()),
        of_trimesh,
        trimesh.Scene([of_trimesh]),
    ]
    expected = shrec11.classify(HAND)
    for result in shrec11.classify_many(kinds):
        assert isinstance(result, meshconv3d.Prediction), result
        assert result.label == expected.label == "hand"
        np.testing.assert_allclose(result.scores, expected.scores, rtol=1e-4, atol=1e-4)


def test_the_repr_is_for_people(shrec11: meshconv3d.Classifier) -> None:
    shown = repr(shrec11.classify(HAND))
    assert re.fullmatch(r"<Prediction: hand \d+\.\d%, then \w+ \d+\.\d%, \w+ \d+\.\d%>", shown)
    cube = trimesh.creation.box()
    assert repr(shrec11.classify(cube)).startswith("<Prediction: unknown, nearest is ")


@pytest.mark.parametrize(
    ("mesh", "fault"),
    [
        ("nothing.stl", "unreadable"),
        ("no\0path.stl", "unreadable"),
        (b"nothing", "unknown-format"),
        (([[0, 0, 0], [1, 0, 0]], [[0, 1, 2]]), "index-out-of-range"),
        (([[0, 0, 0], [1, 0]], [[0, 1, 2]]), "no-mesh"),
        ((np.zeros((4, 2)), [[0, 1, 2]]), "bad-vertices"),
        ((np.eye(3), [[0, 1, 2, 0]]), "bad-faces"),
        ((np.eye(3), np.array([[0, 1, 2]], "m8[s]")), "bad-faces"),
        (trimesh.PointCloud([[0.0, 0.0, 0.0]]), "no-faces"),
        (trimesh.Scene(), "no-faces"),
        ([HAND, HAND, HAND], "no-mesh"),
        (None, "no-mesh"),
    ],
)
def test_failures_are_of_one_type(shrec11: meshconv3d.Classifier, mesh, fault: str) -> None:
    with pytest.raises(meshconv3d.MeshError) as error:
        shrec11.classify(mesh)
    assert error.value.fault == fault
    [result] = shrec11.classify_many([mesh])
    assert isinstance(result, meshconv3d.MeshError)
    assert result.fault == fault


def test_a_model_that_is_not_there(tmp_path: Path) -> None:
    for error in (meshconv3d.ModelFileError, meshconv3d.Error):
        with pytest.raises(error, match="neither a shipped model"):
            meshconv3d.load(tmp_path / "none.onnx")


@pytest.mark.parametrize("name", PAGES)
def test_pages_made_from_the_code_are_those_of_today(name: str) -> None:
    """python -m docs.reference makes them anew."""
    assert (ROOT / "docs" / name).read_text(encoding="utf-8") == PAGES[name]()
