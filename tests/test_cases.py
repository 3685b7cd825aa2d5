"""Reported files and calls, each with its right value, where the shared cases are at hand.

Cases that need a running service, a terminal or training are tested with constructs of their own
beside the code that they concern.
"""

import io
import struct
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner
from numpy.typing import NDArray

from meshconv3d.model.errors import MeshError
from meshconv3d.model.loading import load_mesh
from meshconv3d.model.mesh import Mesh
from meshconv3d.service.classifier import Classifier
from meshconv3d.service.cli.main import commands
from tests.articulated import sample_paths

CASES = Path(__file__).parents[2] / "shared" / "cases"

pytestmark = pytest.mark.skipif(
    not CASES.is_dir(), reason="needs the shared cases, which a clone does not have"
)

# case/file -> faces and area
READ = {
    "01-off-glued-header/cube.off": (12, 6),
    "01-off-glued-header/coff.off": (12, 6),
    "02-obj-backslash/group.obj": (12, 6),
    "02-obj-backslash/comment.obj": (12, 6),
    "02-obj-backslash/mtllib.obj": (12, 6),
    "04-concave-polygons/comb_E-polygons.obj": (None, 23.7),
    "04-concave-polygons/comb_E-polygons.off": (None, 23.7),
    "04-concave-polygons/comb_E-polygons.ply": (None, 23.7),
    "04-concave-polygons/plane-polygons.obj": (None, 43.84),
    "04-concave-polygons/star-polygons.obj": (None, 18),
    "07-gltf-skins/skins.glb": (24, 12),
    "10-utf16/obj_utf16.obj": (12, None),
    "10-utf16/off_utf16.off": (12, None),
    "10-utf16/ply_utf16.ply": (12, None),
    "10-utf16/stl_utf16.stl": (12, None),
    "10-utf16/utf16.gltf": (12, None),
    "12-stl-free-form/stl_oneline.stl": (12, 6),
    "12-stl-free-form/stl_facet_line.stl": (12, 6),
    "18-gltf-instancing/inst_opt.glb": (36, 18),
    "18-gltf-instancing/inst_req.glb": (36, 18),
    "19-3mf-modifier-volumes/negative_volume.3mf": (12, 6),
    "23-3mf-relative-target/reldot.3mf": (12, 6),
    "28-corpus/bin.off": (1, None),
    "28-corpus/C.obj": (None, 7),
    "28-corpus/L.off": (None, 3),
    "28-corpus/plain.gltf": (None, None),
    "28-corpus/normalized.gltf": (None, None),
    "28-corpus/ragged.ply": (None, None),
}

# case/file -> words of the reason
REFUSED = {
    "03-hash-inside-number/ind.obj": "NaN|finite|number",
    "03-hash-inside-number/inf.obj": "infinite|finite|number",
    "03-hash-inside-number/inf.off": "infinite|finite|number",
    "28-corpus/nofaces_index0.obj": "begin at 1",
}


def area_of(mesh: Mesh) -> float:
    a, b, c = (mesh.vertices[mesh.faces[:, k]] for k in range(3))
    return float(np.linalg.norm(np.cross(b - a, c - a), axis=1).sum() / 2)


@pytest.mark.parametrize("name", READ)
def test_a_file_is_read_as_it_is_meant(name: str) -> None:
    faces, area = READ[name]
    mesh = load_mesh(CASES / name)
    assert len(mesh.faces) > 0
    if faces is not None:
        assert len(mesh.faces) == faces
    if area is not None:
        assert area_of(mesh) == pytest.approx(area, abs=0.005)


@pytest.mark.parametrize("name", REFUSED)
def test_a_file_is_refused_for_its_reason(name: str) -> None:
    with pytest.raises(MeshError, match=REFUSED[name]):
        load_mesh(CASES / name)


def test_a_skinned_mesh_ignores_the_transform_of_its_node() -> None:
    vertices = load_mesh(CASES / "07-gltf-skins" / "skins.glb").vertices
    assert vertices.min(0).tolist() == pytest.approx([-0.5, -0.5, -0.5])
    assert vertices.max(0).tolist() == pytest.approx([3.5, 0.5, 0.5])


def test_a_node_that_a_scene_lists_twice_is_drawn_once() -> None:
    once = load_mesh(CASES / "28-corpus" / "plain.gltf")
    both = load_mesh(CASES / "28-corpus" / "root_and_child.gltf")
    assert len(both.faces) == len(once.faces)


@pytest.mark.parametrize("model", ["shrec11", "objects"])
def test_polygons_are_what_their_triangles_are(model: str) -> None:
    classifier = Classifier.load(model)
    for name in ("comb_E", "plane", "star"):
        polygons, triangles = (
            classifier.classify(CASES / "04-concave-polygons" / f"{name}-{kind}.obj")
            for kind in ("polygons", "triangles")
        )
        assert (polygons.label, polygons.unknown) == (triangles.label, triangles.unknown)
        assert polygons.probability == pytest.approx(triangles.probability, abs=0.15)


def test_a_volume_mesh_is_its_shell() -> None:
    classifier = Classifier.load("objects")
    report = classifier.classify(CASES / "28-corpus" / "cells20.obj").report
    assert report.within_budget
    assert report.area_kept == pytest.approx(1, abs=0.05)


def loose_triangles(count: int) -> bytes:
    """A binary STL of small triangles, none of which touches another."""
    random = np.random.default_rng(0)
    records = np.zeros(count, [("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("rest", "<u2")])
    records["corners"] = random.random((count, 1, 3)) + 0.02 * random.random((count, 3, 3))
    return bytes(80) + struct.pack("<I", count) + records.tobytes()


@pytest.mark.parametrize("model", ["shrec11", "objects"])
def test_many_loose_triangles_cost_no_more_than_the_budget(model: str) -> None:
    result = Classifier.load(model).classify(loose_triangles(40_000), "stl")
    report = result.report
    assert (report.faces_used, report.within_budget) == (500, True)
    assert report.components_lost == 39_500
    assert report.area_kept < 0.15
    assert result.unknown


TETRAHEDRON = np.array([(1, 1, 1), (1, -1, -1), (-1, 1, -1), (-1, -1, 1)], float)
TETRAHEDRON_FACES = np.array([(0, 1, 2), (0, 3, 1), (0, 2, 3), (1, 3, 2)])


def obj(vertices: NDArray[np.float64], faces: NDArray) -> bytes:
    text = io.StringIO()
    np.savetxt(text, vertices, "v %.9g %.9g %.9g")
    np.savetxt(text, faces + 1, "f %d %d %d")
    return text.getvalue().encode()


@pytest.mark.parametrize("model", ["shrec11", "objects"])
@pytest.mark.parametrize("sample", ["hand", "lamp", "two_balls"])
def test_specks_change_no_class(model: str, sample: str) -> None:
    classifier = Classifier.load(model)
    mesh = load_mesh(sample_paths()[sample])
    alone = classifier.classify(obj(mesh.vertices, mesh.faces), "obj")
    low, high = mesh.vertices.min(0), mesh.vertices.max(0)
    for count in (1, 10):
        random = np.random.default_rng(0)
        centres = low + (high - low).max() * random.random((count, 3))
        specks = centres[:, None] + 0.002 * (high - low).max() * TETRAHEDRON
        first = len(mesh.vertices) + 4 * np.arange(count)
        vertices = np.vstack([mesh.vertices, specks.reshape(-1, 3)])
        faces = np.vstack([mesh.faces, (first[:, None, None] + TETRAHEDRON_FACES).reshape(-1, 3)])
        result = classifier.classify(obj(vertices, faces), "obj")
        assert (result.label, result.unknown) == (alone.label, alone.unknown)
        assert result.report.components_lost >= 0


BOX = np.array([(x, y, z) for x in (0, 1) for y in (0, 1) for z in (0, 1)], float)
BOX_FACES = np.array(
    [
        *((0, 1, 3), (0, 3, 2), (4, 6, 7), (4, 7, 5), (0, 4, 5), (0, 5, 1)),
        *((2, 3, 7), (2, 7, 6), (0, 2, 6), (0, 6, 4), (1, 5, 7), (1, 7, 3)),
    ]
)


@pytest.mark.parametrize("count", [27, 64, 512])
def test_boxes_are_not_crumpled(count: int) -> None:
    """Boxes keep most of their surface, or are refused."""
    side = round(count ** (1 / 3))
    places = np.array([(i % side, i // side % side, i // side**2) for i in range(count)], float)
    vertices = (places[:, None] + 0.9 * BOX).reshape(-1, 3)
    faces = (8 * np.arange(count)[:, None, None] + BOX_FACES).reshape(-1, 3)
    classifier = Classifier.load("objects")
    if count == 512:
        with pytest.raises(MeshError, match="too intricate"):
            classifier.classify(obj(vertices, faces), "obj")
        return
    assert classifier.classify(obj(vertices, faces), "obj").report.area_kept > 0.7


def test_a_file_that_a_system_keeps_for_itself_is_passed_over() -> None:
    folder = CASES / "16-appledouble" / "data"
    result = CliRunner().invoke(commands, ["classify", str(folder), "--top", "1"])
    assert result.exit_code == 0
    assert '"fault"' not in result.output


@pytest.mark.parametrize(
    ("name", "words"),
    [
        ("ir99.onnx", "newer onnxruntime than the one that is installed: upgrade it"),
        ("op99.onnx", "newer onnxruntime than the one that is installed: upgrade it"),
        ("ext.onnx", "its weights lie in another file"),
        ("model.safetensors", "meshconv3d export"),
    ],
)
def test_a_model_that_cannot_be_opened_is_told_as_what_it_is(name: str, words: str) -> None:
    path = CASES / "26-model-version-skew" / name
    result = CliRunner().invoke(commands, ["inspect", str(path)])
    assert result.exit_code == 2
    assert words in " ".join(result.output.split())
    assert "damaged" not in result.output
