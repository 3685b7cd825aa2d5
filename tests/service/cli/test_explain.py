"""`meshconv3d explain`: what is written where, and what is refused."""

import json
from pathlib import Path

import pytest

from meshconv3d.model.loading import load_mesh
from tests.commands import meshconv3d


def explain(model_file: Path, *arguments: object) -> tuple[int, list[dict], str]:
    done = meshconv3d("explain", "--model", model_file, *arguments)
    return done.returncode, [json.loads(line) for line in done.stdout.splitlines()], done.stderr


@pytest.mark.parametrize("name", ["out.glb", "out.ply", "OUT.GLB", "new/folder/out.glb"])
def test_a_mesh_as_a_coloured_file(
    model_file: Path, meshes: Path, tmp_path: Path, name: str
) -> None:
    code, (record,), _ = explain(model_file, meshes / "ring.obj", "-o", tmp_path / name)
    assert code == 0
    assert "explain" in record["timings_ms"]
    assert len(load_mesh(tmp_path / name).faces) == 500


def test_numbers_of_a_chosen_class(model_file: Path, meshes: Path, tmp_path: Path) -> None:
    out = tmp_path / "why.json"
    for label in ("ball", "box"):
        code, (record,), _ = explain(model_file, meshes / "ring.obj", "-o", out, "--class", label)
        assert code == 0
        evidence = json.loads(out.read_text())["evidence"]
        score = next(score["score"] for score in record["scores"] if score["class"] == label)
        assert (evidence["class"], evidence["file"]) == (label, "ring.obj")
        assert sum(evidence["contributions"]) + evidence["bias"] == pytest.approx(score, abs=1e-4)


def test_a_mesh_that_cannot_be_used_leaves_nothing(
    model_file: Path, meshes: Path, tmp_path: Path
) -> None:
    code, (record,), _ = explain(model_file, meshes / "points.obj", "-o", tmp_path / "why.glb")
    assert (code, record["error"]["fault"]) == (1, "no-faces")
    assert list(tmp_path.iterdir()) == []


def test_standard_input(model_file: Path, meshes: Path, tmp_path: Path) -> None:
    done = meshconv3d(
        *("explain", "-", "--model", model_file, "-o", tmp_path / "why.glb"),
        stdin=(meshes / "ring.obj").read_bytes(),
    )
    assert done.returncode == 0, done.stderr
    assert (tmp_path / "why.glb").is_file()


def test_a_link_is_replaced_and_what_it_leads_to_stays(
    model_file: Path, meshes: Path, tmp_path: Path
) -> None:
    out, theirs = tmp_path / "why.glb", tmp_path / "theirs"
    theirs.write_text("theirs")
    out.symlink_to(theirs)
    assert explain(model_file, meshes / "ring.obj", "-o", out)[0] == 0
    assert not out.is_symlink()
    assert theirs.read_text() == "theirs"


def test_calls_that_cannot_be_carried_out(model_file: Path, meshes: Path, tmp_path: Path) -> None:
    ring = meshes / "ring.obj"
    mine = tmp_path / "mine.ply"
    mine.write_bytes(b"ply")
    for arguments, reason in (
        ((ring, meshes / "sheet.obj", "-o", tmp_path / "a.glb"), "unexpected extra argument"),
        ((meshes, "-o", tmp_path / "a.glb"), "is no file: explain takes one mesh"),
        ((tmp_path / "none.obj", "-o", tmp_path / "a.glb"), "no such file"),
        ((ring, "-o", tmp_path / "a.stl"), "a form that is written: .glb, .ply, .json"),
        ((ring, "-o", tmp_path), "is a directory"),
        ((ring,), "Missing option '-o'"),
        ((mine, "-o", mine), "is the mesh itself"),
        ((ring, "-o", tmp_path / "a.glb", "--class", "cup"), "no class 'cup', but ball, box, ring"),
    ):
        code, records, errors = explain(model_file, *arguments)
        assert (code, records) == (2, []), reason
        assert reason in " ".join(errors.split())
    assert {path: path.read_bytes() for path in tmp_path.iterdir()} == {mine: b"ply"}
