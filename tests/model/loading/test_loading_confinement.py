"""Nothing but the given bytes is read: no file beside them, no connection."""

import json
import sys
from contextlib import suppress

import loading_builders as build
import numpy as np
import pytest

from meshconv3d.model.errors import MalformedFile, MeshError
from meshconv3d.model.loading import load_mesh

EVENTS: list[tuple[str, object]] = []
WATCHED = ("open", "socket.connect", "socket.getaddrinfo", "urllib.Request", "subprocess.Popen")


def _watch(event: str, arguments: tuple) -> None:
    if event in WATCHED:
        EVENTS.append((event, arguments[0]))


@pytest.fixture(scope="module", autouse=True)
def watching():
    # What is imported lazily is imported now: it may open its own files.
    for extension, data in build.SPELLINGS.values():
        load_mesh(data, extension)
    sys.addaudithook(_watch)


def opened_by(data: bytes, name: str) -> list:
    EVENTS.clear()
    with suppress(MeshError):
        load_mesh(data, name)
    return EVENTS.copy()


@pytest.fixture
def planted(tmp_path, monkeypatch):
    """A material, a texture and a buffer, in the working directory, where they would be found."""
    monkeypatch.chdir(tmp_path)
    (tmp_path / "box.mtl").write_text("newmtl a\nmap_Kd box.png\n")
    (tmp_path / "box.png").write_bytes(b"\x89PNG")
    (tmp_path / "box.bin").write_bytes(build.gltf_document()[1])
    return tmp_path


def test_the_watch_sees_an_open(planted):
    EVENTS.clear()
    (planted / "box.mtl").read_text()
    assert EVENTS


@pytest.mark.parametrize(("extension", "data"), build.SPELLINGS.values())
def test_plain_files_open_nothing(extension, data):
    assert opened_by(data, extension) == []


@pytest.mark.parametrize("folder", ["", "absolute", "http://127.0.0.1:9/"])
def test_references_are_never_followed(planted, folder):
    folder = f"{planted}/" if folder == "absolute" else folder
    obj = f"mtllib {folder}box.mtl\n".encode() + build.obj() + b"usemtl a\nf 1 2 3\n"
    ply = build.ply_ascii().replace(b"a box", f"TextureFile {folder}box.png".encode())
    document, _ = build.gltf_document()
    document["buffers"][0]["uri"] = f"{folder}box.bin"
    gltf = json.dumps(document).encode()
    glb = build.pack_glb(document, b"")
    for name, data in (("obj", obj), ("ply", ply), ("gltf", gltf), ("glb", glb)):
        assert opened_by(data, name) == []
        assert opened_by(data, f"box.{name}") == []
    with pytest.raises(MalformedFile, match=r"\.glb") as caught:
        load_mesh(gltf, "gltf")
    assert caught.value.fault == "external-reference"


def test_a_path_opens_itself_alone(planted):
    path = planted / "box.obj"
    path.write_bytes(b"mtllib box.mtl\n" + build.obj())
    EVENTS.clear()
    load_mesh(path)
    assert [target for _, target in EVENTS] == [str(path)]


def test_external_images_are_no_hindrance():
    document, data = build.gltf_document()
    document["images"] = [{"uri": "box.png"}]
    document["textures"] = [{"source": 0}]
    document["materials"] = [{"pbrMetallicRoughness": {"baseColorTexture": {"index": 0}}}]
    document["meshes"][0]["primitives"][0]["material"] = 0
    assert build.is_box(load_mesh(build.pack_glb(document, data)))
    assert np.isfinite(load_mesh(build.pack_gltf(document, data)).vertices).all()
