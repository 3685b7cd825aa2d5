"""Runtimes of other languages give the scores of the package for a whole pipeline."""

import os
import shutil
import subprocess
import sys
import threading
from collections.abc import Iterator, Sequence
from functools import partial
from http.server import SimpleHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path
from typing import Any
from urllib.parse import urlencode

import numpy as np
import pytest
from playwright.sync_api import Browser, expect

from meshconv3d.export.runtime import onnxruntime
from meshconv3d.model.loading import load_mesh
from meshconv3d.model.mesh import Mesh
from meshconv3d.model.samples import sample_paths
from meshconv3d.model.topology.inputs import whole_inputs
from meshconv3d.service.models import Model
from tests.examples.conftest import scores_of
from tests.meshes import soup, write_off
from tests.service.page.conftest import browser, chromium  # noqa: F401 (fixtures)

EXAMPLES = Path(__file__).parents[2] / "examples"
JAVASCRIPT = EXAMPLES / "javascript"


def run(*command: object) -> list[str]:
    done = subprocess.run(
        [str(part) for part in command],
        capture_output=True,
        text=True,
        cwd=EXAMPLES,
        env={"PATH": os.environ["PATH"], "ORT_DISABLE_TELEMETRY": "1"},
        timeout=120,
    )
    assert done.returncode == 0, done.stderr
    return done.stdout.splitlines()


def assert_best(lines: Sequence[str], model: Model, mesh: Path) -> None:
    """Three lines are the three best classes and their scores."""
    expected = list(scores_of(model, mesh).items())[:3]
    found = [line.rsplit(" ", 1) for line in lines]
    assert [name for name, _ in found] == [name for name, _ in expected]
    for (_, ours), (_, theirs) in zip(found, expected, strict=True):
        assert float(ours) == pytest.approx(theirs, abs=1e-3)


@pytest.fixture(scope="module")
def node() -> str:
    """Node.js, with the packages of the examples."""
    program = shutil.which("node")
    if program is None:
        pytest.skip("no Node.js: apt-get install nodejs npm")
    if not (JAVASCRIPT / "node_modules").is_dir():
        pytest.skip("no packages: npm ci --ignore-scripts --prefix examples/javascript")
    return program


@pytest.mark.parametrize("name", ["chair", "wolf"])
def test_python_with_onnxruntime_and_numpy_alone(
    whole_model: Path, model: Model, prepared_samples: dict[str, Path], name: str
) -> None:
    mesh = prepared_samples[name]
    # Isolated from the working folder, in which the package lies.
    lines = run(sys.executable, "-I", EXAMPLES / "any_runtime.py", whole_model, mesh)
    assert_best(lines, model, mesh)


def test_the_python_example_takes_nothing_of_ours() -> None:
    lines = (EXAMPLES / "any_runtime.py").read_text().splitlines()
    imports = [line for line in lines if line.startswith(("import", "from"))]
    assert imports == ["import json", "import sys", "import numpy as np", "import onnxruntime"]


@pytest.mark.parametrize("name", ["chair", "wolf"])
def test_node(
    node: str, whole_model: Path, model: Model, prepared_samples: dict[str, Path], name: str
) -> None:
    mesh = prepared_samples[name]
    assert_best(run(node, JAVASCRIPT / "node.js", whole_model, mesh), model, mesh)


def test_a_mesh_that_is_not_prepared(node: str, whole_model: Path, tmp_path: Path) -> None:
    """Of another unit and place, with open seams and faces turned over: a chair all the same."""
    mesh = load_mesh(sample_paths()["chair"])
    torn = soup(mesh)
    faces = np.array(torn.faces)
    faces[::3] = faces[::3, ::-1]
    write_off(tmp_path / "chair.off", Mesh(torn.vertices * 40 + 7, faces))
    (line,) = run(node, JAVASCRIPT / "any-mesh.js", whole_model, tmp_path / "chair.off")
    assert line.startswith("chair ")


def readme_block(language: str) -> str:
    """The example of a whole pipeline in the README."""
    (block,) = (
        block.partition("\n```")[0]
        for block in (EXAMPLES.parent / "README.md").read_text().split(f"```{language}\n")
        if block.partition("\n```")[0].count("whole.onnx")
    )
    assert len(block.splitlines()) <= 5
    return block


def test_the_lines_of_python_in_the_readme(
    whole_model: Path, model: Model, prepared_samples: dict[str, Path]
) -> None:
    mesh = prepared_samples["wolf"]
    given: dict[str, Any] = {"onnxruntime": onnxruntime, **whole_inputs(load_mesh(mesh))}
    exec(readme_block("py").replace("whole.onnx", str(whole_model)), given)
    best = given["scores"][0].max()
    assert best == pytest.approx(max(scores_of(model, mesh).values()), abs=1e-3)


def test_the_lines_of_javascript_in_the_readme(
    node: str, whole_model: Path, model: Model, prepared_samples: dict[str, Path], tmp_path: Path
) -> None:
    mesh = prepared_samples["wolf"]
    runtime = JAVASCRIPT / "node_modules/onnxruntime-node/dist/index.js"
    block = readme_block("js").replace("whole.onnx", str(whole_model))
    block = block.replace('"onnxruntime-web"', f'"{runtime.as_uri()}"')
    arrays = whole_inputs(load_mesh(mesh))
    (tmp_path / "lines.mjs").write_text(
        f"const vertices = new Float32Array({arrays['vertices'].ravel().tolist()});\n"
        f"const faces = BigInt64Array.from({arrays['faces'].ravel().tolist()}, BigInt);\n"
        f"{block}\nconsole.log(Math.max(...scores.data));"
    )
    (line,) = run(node, tmp_path / "lines.mjs")
    assert float(line) == pytest.approx(max(scores_of(model, mesh).values()), abs=1e-3)


@pytest.fixture(scope="module")
def compiled(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The C++ example, with the library that comes with onnxruntime for Python."""
    places = [os.environ.get("ONNXRUNTIME_INCLUDE", ""), "/usr/include/onnxruntime"]
    headers = [place for place in places if (Path(place) / "onnxruntime_cxx_api.h").is_file()]
    if not headers:
        pytest.skip("no onnxruntime_cxx_api.h in /usr/include/onnxruntime or ONNXRUNTIME_INCLUDE")
    if not (shutil.which("cmake") and shutil.which("c++")):
        pytest.skip("no CMake or C++ compiler: apt-get install cmake g++")
    root = tmp_path_factory.mktemp("onnxruntime")
    (root / "lib").mkdir()
    (library,) = Path(onnxruntime.__file__).parent.glob("capi/libonnxruntime.so.*")
    for name in ("libonnxruntime.so", "libonnxruntime.so.1"):
        (root / "lib" / name).symlink_to(library)
    (root / "include").symlink_to(headers[0])
    build = root / "build"
    run("cmake", "-S", EXAMPLES / "cpp", "-B", build, f"-DCMAKE_PREFIX_PATH={root}")
    run("cmake", "--build", build)
    return build / "any_runtime"


@pytest.mark.parametrize("name", ["chair", "wolf"])
def test_cpp(
    compiled: Path, whole_model: Path, model: Model, prepared_samples: dict[str, Path], name: str
) -> None:
    mesh = prepared_samples[name]
    assert_best(run(compiled, whole_model, mesh), model, mesh)


@pytest.fixture(scope="module")
def site(
    node: str, whole_model: Path, prepared_samples: dict[str, Path], tmp_path_factory
) -> Iterator[str]:
    """The address of a server with the page of the example, the pipeline and the meshes."""
    folder = tmp_path_factory.mktemp("site")
    for path in (*JAVASCRIPT.iterdir(), *prepared_samples.values()):
        (folder / path.name).symlink_to(path)
    (folder / "whole.onnx").symlink_to(whole_model)
    handler = partial(SimpleHTTPRequestHandler, directory=str(folder))
    with ThreadingHTTPServer(("127.0.0.1", 0), handler) as server:
        threading.Thread(target=server.serve_forever, daemon=True).start()
        yield f"http://127.0.0.1:{server.server_port}"
        server.shutdown()


@pytest.mark.parametrize("name", ["chair", "wolf"])
def test_a_browser(
    site: str,
    browser: Browser,  # noqa: F811
    model: Model,
    prepared_samples: dict[str, Path],
    name: str,
) -> None:
    page = browser.new_page()
    page.goto(f"{site}/index.html?" + urlencode({"model": "whole.onnx", "mesh": f"{name}.off"}))
    shown = page.locator("pre")
    expect(shown).not_to_be_empty()
    assert_best(shown.inner_text().splitlines(), model, prepared_samples[name])
    page.close()
