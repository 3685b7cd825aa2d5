"""The command on a small data set."""

import json
import sys
from pathlib import Path

import pytest

from benchmarks import baselines
from benchmarks.baseline_methods.points import Points
from meshconv3d.model.mesh import Mesh
from tests.meshes import icosphere, sheet, torus


def write(mesh: Mesh, path: Path, size: float) -> None:
    path.parent.mkdir(parents=True, exist_ok=True)
    vertices = "".join(f"v {x} {y} {z}\n" for x, y, z in size * mesh.vertices)
    faces = "".join(f"f {a} {b} {c}\n" for a, b, c in mesh.faces + 1)
    path.write_text(vertices + faces)


@pytest.fixture
def data(tmp_path: Path) -> Path:
    root = tmp_path / "shapes"
    for label, mesh in {"ball": icosphere(2), "ring": torus(), "sheet": sheet()}.items():
        for i in range(12):
            squeezed = mesh.moved(mesh.vertices * (1, 1, 1 - i / 30))
            split = "train" if i < 8 else "test"
            write(squeezed, root / label / split / f"{i}.obj", size=1 + i)
    (root / "ball" / "test" / "broken.obj").write_text("v 0 0 0\n")
    return root


@pytest.fixture
def results(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setattr(baselines, "RESULTS", tmp_path / "results")
    return tmp_path / "results" / "baselines_shapes.json"


def run(data: Path, monkeypatch: pytest.MonkeyPatch, *options: str) -> None:
    monkeypatch.setattr(sys, "argv", ["baselines", str(data), "--epochs", "2", *options])
    baselines.main()


# Three classes: within five answers is always right.
@pytest.mark.filterwarnings("ignore::sklearn.exceptions.UndefinedMetricWarning")
def test_every_method_has_a_row_and_is_not_run_twice(
    data: Path,
    results: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    run(data, monkeypatch, "--seeds", "0")
    first, kept = capsys.readouterr().out, results.read_text()
    names = [line.split()[0] for line in first.splitlines()[1:]]
    assert names == ["spectrum", "descriptors", "points"]
    summary = json.loads(kept)
    assert (summary["test_meshes"], summary["test_refused"]) == (12, 1)
    spectrum = summary["runs"][0]
    # Everything is right but the file that is broken.
    assert spectrum["top1"] == pytest.approx(12 / 13, abs=1e-5)
    assert spectrum["balanced"] == pytest.approx((4 / 5 + 1 + 1) / 3, abs=1e-5)

    monkeypatch.setattr(Points, "scores", None)
    monkeypatch.setattr(baselines, "read_part", None)
    run(data, monkeypatch, "--seeds", "0")
    assert (capsys.readouterr().out, results.read_text()) == (first, kept)


def test_runs_on_another_split_are_not_taken_for_these(results: Path) -> None:
    results.parent.mkdir()
    runs = [{"method": "spectrum"}]
    results.write_text(json.dumps({"split_sha256": "other", "runs": runs}))
    assert baselines.read_records(results, "this") == []
    assert baselines.read_records(results, "other") == runs
