"""One box in every format is one box; name and content decide the format together."""

import os
import pickle
import subprocess
import sys

import loading_builders as build
import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from meshconv3d.model.errors import MalformedFile, MeshError, UnknownFormat, UnusableMesh
from meshconv3d.model.loading import FORMATS, detect_format, load_mesh

SPELLINGS = pytest.mark.parametrize(
    ("extension", "data"), build.SPELLINGS.values(), ids=build.SPELLINGS.keys()
)


@SPELLINGS
def test_every_spelling_of_the_box_is_the_same_box(extension, data):
    mesh = load_mesh(data, f"Box.{extension.upper()}")
    assert len(mesh.faces) == 12
    assert build.is_box(mesh)
    assert mesh.vertices.min(axis=0).tolist() == [0, 0, 0]
    assert mesh.vertices.max(axis=0).tolist() == [1, 2, 3]


@SPELLINGS
def test_the_content_alone_decides(extension, data):
    assert detect_format(data, None) is FORMATS[extension]
    assert build.is_box(load_mesh(data))


@SPELLINGS
def test_a_path_declares_its_own_name(extension, data, tmp_path):
    for name in (f"box.{extension}", "box"):
        path = tmp_path / name
        path.write_bytes(data)
        assert build.is_box(load_mesh(path))
        assert build.is_box(load_mesh(os.fspath(path)))


@SPELLINGS
def test_a_name_that_contradicts_the_content_is_refused(extension, data):
    # A 3MF is a ZIP archive, and a damaged one is not told from others.
    same = {extension}
    if data.startswith(b"PK"):
        same = {"3mf", "zip"} if extension == "zip" else {extension, "zip"}
    for other in FORMATS.keys() - same:
        with pytest.raises(UnknownFormat, match=extension) as caught:
            load_mesh(data, f"box.{other}")
        assert other in str(caught.value)


@SPELLINGS
def test_a_file_cut_anywhere_is_an_error_or_harmless(extension, data):
    for end in range(0, len(data) - 1, max(1, len(data) // 200)):
        try:
            mesh = load_mesh(data[:end], extension)
        except MeshError:
            continue
        # Text formats do not declare their length: a cut OBJ is a shorter OBJ.
        assert extension == "obj" or build.is_box(mesh)


@SPELLINGS
@settings(
    max_examples=60, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture]
)
@given(seed=st.integers(0, 2**32 - 1))
def test_damaged_bytes_raise_nothing_but_mesh_errors(extension, data, seed):
    random = np.random.default_rng(seed)
    damaged = bytearray(data)
    for _ in range(random.integers(1, 6)):
        damaged[random.integers(len(damaged))] = random.integers(256)
    for name in (extension, None):
        error = _error_of(bytes(damaged), name)
        if error is not None:
            assert str(error)
            again = pickle.loads(pickle.dumps(error))
            assert (type(again), again.fault, str(again)) == (type(error), error.fault, str(error))


def _error_of(data: bytes, name: str | None) -> MeshError | None:
    try:
        load_mesh(data, name)
    except MeshError as error:
        return error
    return None


@given(data=st.binary(max_size=300), extension=st.sampled_from([*FORMATS, None]))
def test_any_bytes_raise_nothing_but_mesh_errors(data, extension):
    with pytest.raises(MeshError):
        load_mesh(data, extension)


def test_an_unknown_extension_lists_what_is_read():
    for name in ("box.iges", "iges", "box.obj.gz", "box."):
        with pytest.raises(UnknownFormat, match="obj, off, stl, ply, glb, gltf, 3mf"):
            load_mesh(build.obj(), name)


def test_content_of_no_format_needs_a_name():
    with pytest.raises(UnknownFormat, match="file name"):
        load_mesh(b"hello")


def test_no_bytes_are_malformed():
    with pytest.raises(MalformedFile, match="empty"):
        load_mesh(b"", "obj")


def test_a_missing_path_is_a_missing_file():
    with pytest.raises(FileNotFoundError):
        load_mesh("no/such/box.obj")


def test_points_alone_are_unusable():
    points = [build.obj([]), build.off([]), build.ply_ascii([]), build.ply_binary([])]
    for data in points:
        with pytest.raises(UnusableMesh) as caught:
            load_mesh(data)
        assert caught.value.fault == "no-faces"


def test_every_format_has_its_own_media_types():
    types = [kind for known in FORMATS.values() for kind in known.media_types]
    assert len(types) == len(set(types))
    assert all(known.extension == key for key, known in FORMATS.items())


def test_neither_pillow_nor_charset_normalizer_is_needed_and_imports_stay_lazy(tmp_path):
    document, data = build.gltf_document()
    coordinates = np.zeros((8, 2), "<f4").tobytes()
    document["meshes"][0]["primitives"][0]["attributes"]["TEXCOORD_0"] = 2
    document["accessors"].append(
        {"bufferView": 2, "componentType": 5126, "count": 8, "type": "VEC2"}
    )
    document["bufferViews"].append(
        {"buffer": 0, "byteOffset": len(data), "byteLength": len(coordinates)}
    )
    document["buffers"][0]["byteLength"] = len(data) + len(coordinates)
    textured = build.obj() + b"vt 0 0\no caf\xe9\n"
    (tmp_path / "box.glb").write_bytes(build.pack_glb(document, data + coordinates))
    (tmp_path / "box.obj").write_bytes(textured.replace(b"f 1 3 4", b"f 1/1 3/1 4/1"))
    (tmp_path / "box.3mf").write_bytes(build.threemf())
    code = (
        "import sys\n"
        "for name in ('PIL', 'charset_normalizer', 'chardet'): sys.modules[name] = None\n"
        "from model.loading import load_mesh\n"
        "assert not {'torch', 'onnx', 'trimesh'} & set(sys.modules)\n"
        "for path in sys.argv[1:]: assert len(load_mesh(path).faces) == 12\n"
    )
    paths = [str(path) for path in tmp_path.iterdir()]
    subprocess.run([sys.executable, "-c", code, *paths], check=True)
