"""`meshconv3d classify --explain`: what is written where, and what is refused."""

import json
from pathlib import Path

import pytest

from meshconv3d.model.loading import load_mesh
from tests.commands import meshconv3d


def explain(model_file: Path, *arguments: object) -> tuple[int, list[dict], str]:
    done = meshconv3d("classify", "--model", model_file, *arguments)
    return done.returncode, [json.loads(line) for line in done.stdout.splitlines()], done.stderr


@pytest.mark.parametrize("name", ["out.glb", "out.ply", "OUT.GLB"])
def test_a_mesh_as_a_coloured_file(
    model_file: Path, meshes: Path, tmp_path: Path, name: str
) -> None:
    code, (record,), _ = explain(model_file, meshes / "ring.obj", "--explain", tmp_path / name)
    assert code == 0
    assert "explain" in record["timings_ms"]
    assert len(load_mesh(tmp_path / name).faces) == 500


def test_numbers_of_a_chosen_class(model_file: Path, meshes: Path, tmp_path: Path) -> None:
    out = tmp_path / "why.json"
    for label in ("ball", "box"):
        code, (record,), _ = explain(
            model_file, meshes / "ring.obj", "--explain", out, "--class", label
        )
        assert code == 0
        evidence = json.loads(out.read_text())["evidence"]
        score = next(score["score"] for score in record["scores"] if score["class"] == label)
        assert (evidence["class"], evidence["file"]) == (label, "ring.obj")
        assert sum(evidence["contributions"]) + evidence["bias"] == pytest.approx(score, abs=1e-4)


def test_several_meshes_go_into_a_folder(model_file: Path, meshes: Path, tmp_path: Path) -> None:
    """Those that cannot be used leave nothing; their records say why."""
    code, records, _ = explain(model_file, meshes, "--explain", tmp_path / "why")
    assert code == 1
    assert len(records) == 5
    written = sorted(str(p.relative_to(tmp_path)) for p in tmp_path.rglob("*") if p.is_file())
    assert written == ["why/below/cube.OBJ.glb", "why/ring.obj.glb", "why/sheet.obj.glb"]


def test_standard_input(model_file: Path, meshes: Path, tmp_path: Path) -> None:
    done = meshconv3d(
        *("classify", "-", "--model", model_file, "--explain", tmp_path),
        stdin=(meshes / "ring.obj").read_bytes(),
    )
    assert done.returncode == 0, done.stderr
    assert (tmp_path / "stdin.glb").is_file()


def test_calls_that_cannot_be_carried_out(model_file: Path, meshes: Path, tmp_path: Path) -> None:
    ring, sheet = meshes / "ring.obj", meshes / "sheet.obj"
    mine = tmp_path / "mine.ply"
    mine.write_bytes(b"ply")
    other = tmp_path / "mine.ply.glb"
    other.write_bytes(b"glTF")
    for arguments, reason in (
        ((ring, sheet, "--explain", tmp_path / "a.glb"), "is one file for 2"),
        ((ring, "--explain", tmp_path / "a.stl"), "neither a folder nor a file with .glb, .ply"),
        ((ring, "--explain", ring), "neither a folder nor a file"),
        ((mine, "--explain", mine), "overwrite a mesh of the call"),
        ((mine, other, "--explain", tmp_path), f"overwrite a mesh of the call: {other}"),
        ((ring, "--class", "ball"), "add --explain"),
        ((ring, "--explain", tmp_path, "--class", "cup"), "no class 'cup', but ball, box, ring"),
    ):
        code, records, errors = explain(model_file, *arguments)
        assert (code, records) == (2, []), reason
        assert reason in " ".join(errors.split())
    assert {path: path.read_bytes() for path in tmp_path.iterdir()} == {
        mine: b"ply",
        other: b"glTF",
    }
