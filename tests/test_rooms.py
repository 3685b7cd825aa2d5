"""Who may import whom, and what need not be installed to classify."""

import json
import re
import subprocess
import sys
from pathlib import Path

import pytest

from meshconv3d.model.samples import sample_paths
from tests.commands import environment

ROOT = Path(__file__).parents[1]
# Commands whose help needs no settings.
LIGHT = ("classify", "batch", "explain", "evaluate", "inspect")

# Runs the command line with the modules of the extras out of reach.
WITHOUT_EXTRAS = """
import sys
from importlib.machinery import PathFinder

EXTRAS = {"torch", "onnx", "onnxscript", "safetensors", "matplotlib"}
EXTRAS |= {"manifold3d", "PIL", "jinja2", "shapely", "skimage", "fsspec", "pyarrow", "ray", "scipy"}

class WithoutExtras(PathFinder):
    @classmethod
    def find_spec(cls, name, path=None, target=None):
        if name.partition(".")[0] in EXTRAS:
            return None
        return super().find_spec(name, path, target)

sys.meta_path = [WithoutExtras if finder is PathFinder else finder for finder in sys.meta_path]
from meshconv3d.service.cli.main import main
main()
"""


def python(program: str, *arguments: object) -> subprocess.CompletedProcess[str]:
    command = [sys.executable, "-c", program, *map(str, arguments)]
    return subprocess.run(
        command, capture_output=True, text=True, env=environment(), cwd=ROOT, timeout=120
    )


def loaded_by(program: str) -> set[str]:
    """The top-level packages that a fresh interpreter holds after the program."""
    show = "\nimport sys; print('|'.join({name.partition('.')[0] for name in sys.modules}))"
    done = python(program + show)
    assert done.returncode == 0, done.stderr
    return set(done.stdout.splitlines()[-1].split("|"))


def test_the_rooms_keep_to_their_imports() -> None:
    # In a process of its own: it would silence this one's loggers.
    done = python("from importlinter.cli import lint_imports_command as c; c(['--no-cache'])")
    assert done.returncode == 0, done.stdout
    assert re.search(r"[1-9]\d* kept, 0 broken", done.stdout), done.stdout


def test_model_loads_neither_torch_nor_onnx() -> None:
    light = "from meshconv3d.model import loading, preparation, topology"
    packages = loaded_by(light)
    assert "numpy" in packages
    assert packages.isdisjoint({"torch", "onnx", "onnxscript", "safetensors"})


def test_serving_loads_neither_torch_nor_onnx() -> None:
    packages = loaded_by("import meshconv3d.service.http.app, meshconv3d.service.cli.classify")
    assert {"onnxruntime", "fastapi"} <= packages
    assert packages.isdisjoint({"torch", "onnx", "onnxscript", "safetensors", "matplotlib"})


@pytest.mark.parametrize(
    "arguments",
    [["--version"], ["--help"], *([command, "--help"] for command in LIGHT)],
)
def test_short_answers_wait_for_no_heavy_import(arguments: list[str]) -> None:
    program = f"""
import sys
sys.argv = ["meshconv3d", *{arguments}]
from meshconv3d.service.cli.main import main
try:
    main()
except SystemExit as end:
    assert end.code == 0
"""
    packages = loaded_by(program)
    heavy = {"numpy", "numba", "fastapi", "pydantic", "onnxruntime", "trimesh", "rich", "torch"}
    assert packages.isdisjoint(heavy)


def test_classifying_needs_no_extra() -> None:
    names = ["boat", "car", "house"]
    done = python(WITHOUT_EXTRAS, "classify", *(sample_paths()[name] for name in names))
    assert (done.returncode, done.stderr) == (0, "")
    assert [json.loads(line)["class"] for line in done.stdout.splitlines()] == names


@pytest.mark.parametrize(
    ("extra", "arguments"),
    [
        ("train", ["train", "{folder}", "--out", "{folder}/out"]),
        ("train", ["export", "{file}", "-o", "{folder}/model.onnx"]),
        ("train", ["verify", "{file}", "--checkpoint", "{file}"]),
        ("teach", ["teach", "{folder}", "-o", "{folder}/model.onnx"]),
        ("remote", ["classify", "memory://meshes"]),
        ("remote", ["batch", "{mesh}", "--output", "memory://all.csv"]),
        ("parquet", ["batch", "{mesh}", "--output", "{folder}/all.parquet"]),
        ("report", ["batch", "{mesh}", "-o", "{folder}/all.csv", "--report", "{folder}/all.html"]),
        ("ray", ["batch", "{mesh}", "-o", "{folder}/all.csv", "--ray", "local"]),
    ],
)
def test_a_missing_extra_is_named_in_one_line(
    tmp_path: Path, extra: str, arguments: list[str]
) -> None:
    file = tmp_path / "file"
    file.touch()
    places = {"folder": tmp_path, "file": file, "mesh": sample_paths()["boat"]}
    given = [argument.format(**places) for argument in arguments]
    done = python(WITHOUT_EXTRAS, *given)
    assert done.returncode == 2
    assert done.stdout == ""
    (line,) = done.stderr.splitlines()
    assert list(tmp_path.iterdir()) == [file]
    assert f"pip install 'meshconv3d[{extra}]'" in line


@pytest.mark.parametrize("command", [["train"], ["export"], ["verify"]])
def test_help_needs_no_extra(command: list[str]) -> None:
    done = python(WITHOUT_EXTRAS, *command, "--help")
    assert (done.returncode, done.stderr) == (0, "")
    assert "--help" in done.stdout
