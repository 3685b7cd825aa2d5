"""Formats that libraries read, each file in a process of its own."""

import tempfile
from contextlib import suppress

import loading_builders as build
import numpy as np
import pytest

from meshconv3d.model.errors import MalformedFile, MeshError, UnknownFormat, UnusableMesh
from meshconv3d.model.loading import (
    Limits,
    converters,
    formats,
    has_mesh_name,
    has_other_format,
    load_mesh,
)
from tests.hostile.converters import FILES
from tests.model.loading import scene_builders as scenes

BOXES = {
    "step": scenes.step(),
    "fbx": scenes.fbx(),
    "dae": scenes.dae(),
    "usda": scenes.usda(),
    "usdz": scenes.usdz({"box.usda": scenes.usda()}),
}


@pytest.mark.parametrize("extension", BOXES)
def test_a_box_is_a_box(extension):
    mesh = load_mesh(BOXES[extension], f"box.{extension.upper()}")
    assert build.is_box(mesh)
    assert len(mesh.faces) == 12
    assert formats.detect_format(BOXES[extension], None).library
    assert has_mesh_name(f"a.{extension}")
    assert not has_other_format(f"a.{extension}")


def test_an_installation_without_the_extra_names_it(monkeypatch):
    monkeypatch.setattr(formats, "find_spec", lambda _: None)
    for extension, data in BOXES.items():
        for name in (f"box.{extension}", None):
            with pytest.raises(UnknownFormat, match=r"meshconv3d\[formats\]"):
                load_mesh(data, name)
    assert formats.TABLE["step"].missing_extra == "formats"


MOVED = 'P: "Lcl Translation", "Lcl Translation", "", "A",10,0,0'
TWICE = 'P: "Lcl Scaling", "Lcl Scaling", "", "A",2,2,2'
OFF = 'P: "Visibility", "Visibility", "", "A",0'


def corners(mesh) -> tuple:
    return tuple(mesh.vertices.min(axis=0)), tuple(mesh.vertices.max(axis=0))


def test_fbx_places_meshes_and_leaves_out_what_is_hidden():
    data = scenes.fbx(
        ("a", 0, MOVED), ("b", 1, f"{MOVED}\n{TWICE}"), ("c", 0, OFF), ("d", 3, MOVED)
    )
    mesh = load_mesh(data, "fbx")
    assert len(mesh.faces) == 24
    assert corners(mesh) == ((10, 0, 0), (22, 4, 6))


def test_dae_places_instances_whatever_their_materials():
    bound = (
        '<bind_material><technique_common><instance_material symbol="a" target="#none"/>'
        "</technique_common></bind_material>"
    )
    shown = f'<instance_geometry url="#g">{bound}</instance_geometry>'
    library = f'<library_nodes><node id="n"><scale>2 2 2</scale>{shown}</node></library_nodes>'
    nodes = f'<node><translate>10 0 0</translate><instance_node url="#n"/>{shown}</node>'
    mesh = load_mesh(scenes.dae(nodes, library), "dae")
    assert len(mesh.faces) == 24
    assert corners(mesh) == ((10, 0, 0), (12, 4, 6))


def test_dae_may_be_utf_16():
    text = scenes.dae().decode().replace("utf-8", "utf-16")
    assert build.is_box(load_mesh(text.encode("utf-16"), "dae"))


def test_usd_places_instances_and_leaves_out_what_is_hidden():
    inside = scenes.usd_mesh()
    moved = (
        "double3 xformOp:translate = (10, 0, 0)\n"
        'uniform token[] xformOpOrder = ["xformOp:translate"]'
    )
    data = scenes.usda(
        f'def Xform "a"\n{{\n{moved}\n{inside}\n}}',
        'def "b" (instanceable = true\nreferences = </a>)\n{\n}',
        scenes.usd_mesh("c", 'token visibility = "invisible"'),
        scenes.usd_mesh("d", 'uniform token purpose = "proxy"'),
        f"""def PointInstancer "e"
{{
    rel prototypes = </e/box>
    int[] protoIndices = [0, 0]
    point3f[] positions = [(0, 20, 0), (0, 40, 0)]
    {inside}
}}""",
    )
    mesh = load_mesh(data, "usda")
    assert len(mesh.faces) == 48
    assert corners(mesh) == ((0, 0, 0), (11, 42, 3))


def test_a_usd_package_refers_to_its_own_files():
    shown = 'def "a" (references = @parts/box.usda@</box>)\n{\n}'
    package = {"a.usda": scenes.usda(shown), "parts/box.usda": scenes.usda()}
    for name in ("a.usdz", None):
        assert build.is_box(load_mesh(scenes.usdz(package), name))


@pytest.mark.parametrize("title", FILES)
def test_a_hostile_file_ends_as_it_must(title):
    file = FILES[title]
    with pytest.raises(MeshError) as caught:
        load_mesh(file.data, file.name, Limits(converter_seconds=30))
    assert caught.value.fault == file.fault, caught.value
    assert "Traceback" not in str(caught.value)


def test_a_process_that_fails_or_hangs_is_an_error(monkeypatch, tmp_path):
    program = tmp_path / "main.py"
    monkeypatch.setattr(converters, "_MAIN", program)
    for text, kind, reason in (
        ("import os; os.abort()", MalformedFile, "fails on it"),
        ("while 1: 1", UnusableMesh, "more than 1 seconds"),
        ("raise SystemExit(4)", UnusableMesh, "set TMPDIR"),  # as `main` ends on a full disk
    ):
        program.write_text(text)
        with pytest.raises(kind, match=reason):
            load_mesh(BOXES["step"], "step", Limits(converter_seconds=1))


def test_a_system_without_temporary_folders_is_told(monkeypatch):
    monkeypatch.setattr(tempfile, "TemporaryDirectory", _full)
    with pytest.raises(UnusableMesh, match="TMPDIR"):
        load_mesh(BOXES["fbx"], "fbx")


def _full(**_: str) -> None:
    raise FileNotFoundError("no usable temporary directory")


@pytest.mark.parametrize("extension", BOXES)
def test_damage_is_an_error(extension):
    data = np.frombuffer(BOXES[extension], np.uint8).copy()
    data[len(data) // 2 : len(data) // 2 + 100] = ord("9")
    with suppress(MeshError):
        assert len(load_mesh(data.tobytes(), extension).faces) <= 12
