"""The page loads and prepares meshes as the package does, number for number."""

import base64
import dataclasses
import json
import subprocess
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import ArrayLike

from meshconv3d.model.errors import MeshError
from meshconv3d.model.loading import load_mesh
from meshconv3d.model.mesh import Mesh
from meshconv3d.model.preparation import prepare_placed
from meshconv3d.model.samples import sample_paths
from tests.hostile import HOSTILE
from tests.meshes import cube, icosphere, moebius, sheet, soup, together, torus
from tests.model.loading.loading_builders import SPELLINGS
from tests.service.page.conftest import require_page_packages

PAGE = Path(__file__).parents[3] / "page"
CASES = Path(__file__).parents[4] / "shared" / "cases"
READ = ("obj", "off", "stl", "ply", "glb", "gltf", "3mf", "amf")
BUDGET = 500
# Cases of this project with files that are not small meshes.
NO_MESHES = ("05-train-refused-validation", "14-train-silently-left-out", "16-appledouble")
Answers = Mapping[str, dict[str, Any]]
RANDOM = np.random.default_rng(5)


def bumpy(levels: int) -> Mesh:
    """A closed surface of 20 * 4^levels faces with noise."""
    sphere = icosphere(levels)
    return sphere.moved(sphere.vertices * RANDOM.normal(1, 0.03, (len(sphere.vertices), 1)))


def boxes(places: ArrayLike, sides: ArrayLike = 1.0) -> Mesh:
    """Cubes of these sides with their lowest corners at these places."""
    placed = zip(np.asarray(places), np.broadcast_to(sides, len(np.asarray(places))), strict=True)
    return together(*(cube().moved(cube().vertices * side + place) for place, side in placed))


def with_faces(mesh: Mesh, change: Callable[[np.ndarray], np.ndarray]) -> Mesh:
    return Mesh(mesh.vertices, change(np.array(mesh.faces)))


def random_share(faces: np.ndarray, share: float) -> np.ndarray:
    return RANDOM.random(len(faces)) < share


def turned(faces: np.ndarray) -> np.ndarray:
    return np.where(random_share(faces, 0.3)[:, None], faces[:, ::-1], faces)


GRID = [(x, y, z) for x in range(4) for y in range(4) for z in range(4)]
MADE = {
    "a cube": cube(),
    "a ring": torus(),
    "a sheet": sheet(),
    "a one-sided strip": moebius(),
    "a ball at the budget": icosphere(2),
    "a ball of separate triangles": soup(icosphere(3)),
    "20480 faces with noise": bumpy(5),
    "5120 faces, some turned": with_faces(bumpy(4), turned),
    "5120 faces, some left out": with_faces(bumpy(4), lambda f: f[random_share(f, 0.8)]),
    "faces that are there twice": with_faces(torus(), lambda f: np.concatenate([f, f[::3, ::-1]])),
    "faces without area": with_faces(torus(), lambda f: np.concatenate([f, f[::5, [0, 0, 1]]])),
    "random triangles": Mesh(RANDOM.normal(size=(300, 3)), RANDOM.integers(0, 300, (400, 3))),
    "cells with walls between": boxes(GRID),
    "boxes that touch in edges": boxes([(0, 0, 0), (1, 1, 0), (2, 0, 0)]),
    "200 boxes": boxes(RANDOM.normal(size=(200, 3)) * 3, RANDOM.uniform(0.1, 1, 200)),
    "dust": together(torus(), boxes(RANDOM.normal(size=(40, 3)), 0.004)),
    "scraps": with_faces(soup(bumpy(4)), lambda f: f[random_share(f, 0.4)]),
    "far from the origin": torus().moved(torus().vertices * 1e-3 + 7),
    "no area": Mesh([[0, 0, 0], [1, 0, 0], [2, 0, 0]], [[0, 1, 2]]),
}


def ply(vertices: ArrayLike, faces: ArrayLike) -> bytes:
    """Vertices and faces as a PLY file, without rounding."""
    points, corners = np.asarray(vertices, "<f8"), np.asarray(faces)
    lists = np.zeros(len(corners), [("count", "u1"), ("corners", "<i4", 3)])
    lists["count"], lists["corners"] = 3, corners
    axes = "".join(f"property double {axis}\n" for axis in "xyz")
    return (
        (
            f"ply\nformat binary_little_endian 1.0\nelement vertex {len(points)}\n{axes}"
            f"element face {len(corners)}\nproperty list uchar int vertex_indices\nend_header\n"
        ).encode()
        + points.tobytes()
        + lists.tobytes()
    )


NO_MESH = {
    "a vertex that is not a number": ply([[0, 0, 0], [1, 0, 0], [0, np.nan, 0]], [[0, 1, 2]]),
    "an index of no vertex": ply([[0, 0, 0], [1, 0, 0], [0, 1, 0]], [[0, 1, 3], [0, 1, -1]]),
    "one point": ply([[1, 1, 1]] * 3, [[0, 1, 2]]),
    "no faces": ply([[0, 0, 0], [1, 0, 0]], np.empty((0, 3))),
    "more than a number can measure": ply([[-1e308, 0, 0], [1e308, 0, 0], [0, 1, 0]], [[0, 1, 2]]),
}


def cases() -> dict[str, Path]:
    """Meshes of the project's cases, where these are."""
    return {
        str(path.relative_to(CASES)): path
        for path in sorted(CASES.rglob("*"))
        if path.suffix[1:] in READ and path.relative_to(CASES).parts[0] not in NO_MESHES
    }


def files(folder: Path) -> dict[str, Path]:
    """All files of this test by their titles."""
    written = {title: ("ply", ply(mesh.vertices, mesh.faces)) for title, mesh in MADE.items()}
    written |= {title: ("ply", content) for title, content in NO_MESH.items()}
    written |= {
        f"a box as {title}": spelling
        for title, spelling in SPELLINGS.items()
        if spelling[0] in READ and "1.0" not in title
    }
    paths = dict(sample_paths()) | cases()
    for number, (title, (extension, content)) in enumerate(written.items()):
        paths[title] = folder / f"{number}.{extension}"
        paths[title].write_bytes(content)
    return paths


def run(paths: Mapping[str, Path]) -> Answers:
    """What the page makes of files, by their titles."""
    require_page_packages(PAGE)
    done = subprocess.run(
        ["node", PAGE / "prepare.js", str(BUDGET), *paths.values()],
        capture_output=True,
        text=True,
        timeout=300,
    )
    assert done.returncode == 0, done.stderr
    return dict(zip(paths, map(json.loads, done.stdout.splitlines()), strict=True))


@pytest.fixture(scope="module")
def paths(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    return files(tmp_path_factory.mktemp("meshes"))


@pytest.fixture(scope="module")
def answers(paths: dict[str, Path]) -> Answers:
    return run(paths)


def array(text: str, dtype: type) -> np.ndarray:
    return np.frombuffer(base64.b64decode(text), dtype).reshape(-1, 3)


def assert_same(found: dict[str, str], mesh: Mesh) -> None:
    np.testing.assert_array_equal(array(found["faces"], np.int32), mesh.faces)
    np.testing.assert_array_equal(array(found["vertices"], np.float64), mesh.vertices)


@pytest.mark.parametrize("title", [*MADE, *NO_MESH, *sample_paths(), "of the cases"])
def test_preparation(title: str, answers: Answers, paths: dict[str, Path]) -> None:
    """Vertices, faces, report and placement, or the words of the refusal, are the package's."""
    for name in cases() if title == "of the cases" else [title]:
        assert_same_answer(answers[name], paths[name])


def assert_same_answer(answer: dict[str, Any], path: Path) -> None:
    refusal = None
    try:
        mesh, report, placement = prepare_placed(load_mesh(path), BUDGET)
    except MeshError as error:
        refusal = error
    if refusal or "error" in answer:
        assert answer.get("error") == str(refusal), path
        assert answer["fault"] == getattr(refusal, "fault", None)
        return
    assert_same(answer["prepared"], mesh)
    assert answer["report"] == dataclasses.asdict(report)
    assert answer["centre"] == placement.centre.tolist()
    assert answer["radius"] == placement.radius


@pytest.mark.parametrize("title", [*sample_paths(), "of the box"])
def test_loading(title: str, answers: Answers, paths: dict[str, Path]) -> None:
    """Triangles are those of the package, before anything is welded."""
    boxes = [name for name in paths if name.startswith("a box as")]
    for name in boxes if title == "of the box" else [title]:
        assert_same(answers[name]["loaded"], load_mesh(paths[name]))


# What a browser has less to fear from than a service has, which counts or forbids it.
UNCOUNTED = (
    "threemf: encrypted",
    "threemf: 20 000 entries",
    "threemf: 98 MB of extra fields",
    "threemf: UTF-7",
    "threemf: an encoding that is none",
    "threemf: mixed encodings",
    "threemf: a namespace of 1 MB",
    "threemf: 40 000 names",
    "threemf: a tag of 3 MB",
    "gltf: vertices of a float count",
)


def test_hostile_files_are_refused(tmp_path: Path) -> None:
    """Those that the package refuses, with words, and none that it reads. Those that take long are
    left out."""
    chosen = {
        title: file
        for title, file in HOSTILE.items()
        if file.name.rpartition(".")[2] in READ and title not in UNCOUNTED
    }
    paths = {}
    for number, (title, file) in enumerate(chosen.items()):
        content = file.data
        if len(content) < 10**6:
            paths[title] = tmp_path / f"{number}.{file.name.rpartition('.')[2]}"
            paths[title].write_bytes(content)
    answers = run(paths)
    assert len(answers) > 250
    wrong = {
        title: answer.get("error")
        for title, answer in answers.items()
        if ("error" in answer) != (chosen[title].fault is not None)
    }
    assert wrong == {}
    assert [
        title for title, answer in answers.items() if "fault" not in answer and "error" in answer
    ] == []


def test_other_formats_are_refused_with_those_that_are_read(tmp_path: Path) -> None:
    paths = {
        "step": tmp_path / "part.step",
        "empty": tmp_path / "empty.obj",
        "named": tmp_path / "a.off",
    }
    for path in paths.values():
        path.write_bytes(b"")
    paths["named"].write_bytes(sample_paths()["nut"].read_bytes())
    answers = run(paths)
    assert "is not read in the browser, which reads obj, off" in answers["step"]["error"]
    assert "which reads more" in answers["step"]["error"]
    assert "is empty" in answers["empty"]["error"]
    assert "its content is STL (stl)" in answers["named"]["error"]
