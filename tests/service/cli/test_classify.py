"""`meshconv3d classify` with its output piped: JSON Lines, faults in place, exit codes."""

import json
import os
import shlex
import signal
import subprocess
from pathlib import Path

import pytest

from tests.articulated import sample_paths
from tests.commands import PROGRAM, environment, meshconv3d, program


def lines(text: str) -> list[dict]:
    return [json.loads(line) for line in text.splitlines()]


def test_each_file_is_a_line_in_the_order_of_the_input(model_file: Path, meshes: Path) -> None:
    """Named files come as named, a folder's sorted and from below too; others are left out."""
    named = [meshes / "sheet.obj", meshes, meshes / "ring.obj"]
    done = program("classify", *named, "--model", model_file)
    assert done.returncode == 1  # two of the folder cannot be used
    assert done.stderr == ""
    found = ["below/cube.OBJ", "cut.stl", "points.obj", "ring.obj", "sheet.obj"]
    records = lines(done.stdout)
    assert [record["file"] for record in records] == [
        str(meshes / name) for name in ("sheet.obj", *found, "ring.obj")
    ]
    bad = {record["file"]: record["error"] for record in records if "error" in record}
    assert set(bad) == {str(meshes / "cut.stl"), str(meshes / "points.obj")}
    assert bad[str(meshes / "points.obj")]["fault"] == "no-faces"
    assert "no triangles" in bad[str(meshes / "points.obj")]["message"]
    good = [record for record in records if "error" not in record]
    assert [record["mesh"]["faces_in"] for record in good] == [512, 12, 500, 512, 500]
    assert all(record["class"] in {"ball", "box", "ring"} for record in good)


def test_all_good_is_exit_0(model_file: Path, meshes: Path) -> None:
    done = meshconv3d(
        "classify",
        meshes / "ring.obj",
        "--top",
        2,
        variables={"MESHCONV3D_MODELS": str(model_file)},
    )
    assert (done.returncode, done.stderr) == (0, "")
    (record,) = lines(done.stdout)
    assert record["model"]["name"] == "tiny"
    assert len(record["scores"]) == 2


def test_the_flag_wins_over_the_variable(model_file: Path, meshes: Path) -> None:
    """And without either, the shipped model answers."""
    mesh = meshes / "ring.obj"
    done = meshconv3d(
        "classify", mesh, "--model", "objects", variables={"MESHCONV3D_MODELS": str(model_file)}
    )
    default = meshconv3d("classify", mesh)
    assert lines(done.stdout)[0]["model"] == lines(default.stdout)[0]["model"]
    assert lines(default.stdout)[0]["model"]["name"] == "objects"


def test_a_named_file_may_be_declared_but_not_one_of_a_folder(
    model_file: Path, meshes: Path, tmp_path: Path
) -> None:
    (tmp_path / "mesh").write_bytes((meshes / "ring.obj").read_bytes())
    call = ("classify", tmp_path / "mesh", meshes / "below", "--model", model_file)
    done = meshconv3d(*call, "--format", "stl")
    mesh, below = lines(done.stdout)
    assert mesh["error"]["fault"] == "format-mismatch"
    assert below["mesh"]["faces_in"] == 12
    done = meshconv3d(*call, "--format", "obj")
    assert (done.returncode, lines(done.stdout)[0]["mesh"]["faces_in"]) == (0, 500)


def test_files_of_other_formats_are_named_at_the_end_and_hidden_ones_passed_over(
    model_file: Path, meshes: Path, tmp_path: Path
) -> None:
    ring = (meshes / "ring.obj").read_bytes()
    for name in ("ring.obj", "._ring.obj", ".cache/ring.obj", "__MACOSX/ring.obj"):
        (tmp_path / name).parent.mkdir(exist_ok=True)
        (tmp_path / name).write_bytes(ring)
    (tmp_path / "cad").mkdir()
    for number in range(12):
        (tmp_path / "cad" / f"{number}.{'iges' if number % 4 == 0 else 'BLEND'}").touch()
    done = meshconv3d("classify", tmp_path, "--model", model_file)
    assert done.returncode == 0
    assert [record["file"] for record in lines(done.stdout)] == [str(tmp_path / "ring.obj")]
    assert done.stderr == "12 files of other formats: .blend 9, .iges 3\n"


@pytest.mark.parametrize("options", [["--format", "obj"], ["--format", "OBJ"], []])
def test_standard_input(model_file: Path, meshes: Path, options: list[str]) -> None:
    content = (meshes / "ring.obj").read_bytes()
    done = meshconv3d("classify", "-", "--model", model_file, *options, stdin=content)
    assert (done.returncode, done.stderr) == (0, "")
    (record,) = lines(done.stdout)
    assert record["file"] == "-"
    assert record["mesh"]["faces_in"] == 500


def test_standard_input_that_is_not_what_it_is_declared_as(meshes: Path) -> None:
    content = (meshes / "ring.obj").read_bytes()
    done = meshconv3d("classify", "-", "--format", "stl", stdin=content)
    assert done.returncode == 1
    (record,) = lines(done.stdout)
    assert record["error"]["fault"] == "format-mismatch"


@pytest.mark.parametrize(
    ("arguments", "variables", "reason"),
    [
        ([], {}, "Missing argument 'PATH...'"),
        (["nothing.obj"], {}, "no such file or folder: nothing.obj"),
        (["{good}", "nothing.obj"], {}, "no such file or folder: nothing.obj"),
        (["{empty}"], {}, "no mesh files under {empty}"),
        (["{good}", "--model", "nothing"], {}, "no model 'nothing'"),
        (["{good}"], {"MESHCONV3D_MODELS": "nothing"}, "no model 'nothing'"),
        (["{good}", "--model", "{good}"], {}, "{good}: the file is damaged or is no ONNX model"),
        (["{good}", "--top", "0"], {}, "--top"),
        (["{good}", "--format", "iges"], {}, "unknown --format 'iges'"),
        (["{good}"], {"MESHCONV3D_PORT": "eighty"}, "bad setting: port"),
    ],
)
def test_a_wrong_call_is_exit_2_and_says_why(
    meshes: Path, tmp_path: Path, arguments: list[str], variables: dict[str, str], reason: str
) -> None:
    places = {"good": meshes / "ring.obj", "empty": tmp_path}
    done = meshconv3d("classify", *(a.format(**places) for a in arguments), variables=variables)
    assert done.returncode == 2
    assert done.stdout == ""
    assert reason.format(**places) in done.stderr
    assert "Traceback" not in done.stderr


def test_a_name_that_is_no_text_is_still_a_record(model_file: Path, tmp_path: Path) -> None:
    content = sample_paths()["ants"].read_bytes()
    with open(os.fsencode(tmp_path) + b"/\xff[red].obj", "wb") as file:
        file.write(content)
    done = meshconv3d("classify", tmp_path, "--model", model_file)
    assert (done.returncode, done.stderr) == (0, "")
    assert lines(done.stdout)[0]["file"].endswith("/\ufffd[red].obj")


@pytest.fixture
def endless(model_file: Path, meshes: Path) -> subprocess.Popen[bytes]:
    """A run over more files than a pipe holds records of, of which one line was read."""
    paths = [str(meshes / "ring.obj")] * 2000
    process = subprocess.Popen(
        [PROGRAM, "classify", "--model", str(model_file), *paths],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        env=environment(),
        # A shell's background job passes on that it ignores interrupts; a terminal's does not.
        preexec_fn=lambda: signal.signal(signal.SIGINT, signal.SIG_DFL),
    )
    assert process.stdout is not None
    assert json.loads(process.stdout.readline())["file"] == paths[0]
    return process


def test_a_closed_pipe_is_no_failure(endless: subprocess.Popen[bytes]) -> None:
    assert endless.stdout is not None
    assert endless.stderr is not None
    endless.stdout.close()
    assert endless.stderr.read() == b""
    assert endless.wait(60) == 0


def test_an_interrupt_ends_without_a_traceback(endless: subprocess.Popen[bytes]) -> None:
    endless.send_signal(signal.SIGINT)
    _, told = endless.communicate(timeout=60)
    assert told.split() == [b"interrupted"]
    assert endless.returncode == 130


@pytest.mark.parametrize(("closed", "status"), [(">&-", 0), ("- <&-", 1)])
def test_a_closed_stream_is_an_empty_one(model_file: Path, meshes: Path, closed: str, status: int):
    path = shlex.quote(str(meshes / "ring.obj"))
    command = f"{PROGRAM} classify --model {shlex.quote(str(model_file))} {path} {closed}"
    done = subprocess.run(
        ["sh", "-c", command], stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, env=environment()
    )
    assert (done.returncode, done.stderr) == (status, b"")
