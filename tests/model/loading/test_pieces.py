"""Files that come in pieces: beside each other, in one ZIP archive, and never from elsewhere."""

import json
import os
from contextlib import suppress

import loading_builders as build
import numpy as np
import pytest

from meshconv3d.model.errors import LimitExceeded, MalformedFile, MeshError, UnknownFormat
from meshconv3d.model.loading import Limits, MeshArchive, load_mesh

NAMES = pytest.mark.parametrize(
    ("uri", "name"),
    [
        ("box.bin", "box.bin"),
        ("./box.bin", "box.bin"),
        ("my%20b%C3%B6x.bin", "my böx.bin"),
        ("my böx.bin", "my böx.bin"),
        ("buffers/a/box.bin", "buffers/a/box.bin"),
        ("buffers\\box.bin", "buffers/box.bin"),
    ],
)
ELSEWHERE = pytest.mark.parametrize(
    "uri",
    [
        "../box.bin",
        "a/../../box.bin",
        "..%2Fbox.bin",
        "..\\box.bin",
        "/etc/hostname",
        "file:///etc/hostname",
        "file:box.bin",
        "http://127.0.0.1:9/box.bin",
        "//127.0.0.1/box.bin",
        "C:\\box.bin",
        "box.bin%00",
        "",
        ".",
        None,
        7,
    ],
)


def fault(error) -> str:
    return error.value.fault


@NAMES
def test_pieces_are_found_by_their_paths(uri, name, tmp_path):
    gltf, data = build.gltf_in_pieces(uri)
    assert build.is_box(load_mesh(gltf, "gltf", pieces={name: data}))
    (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
    (tmp_path / name).write_bytes(data)
    (tmp_path / "box.gltf").write_bytes(gltf)
    assert build.is_box(load_mesh(tmp_path / "box.gltf"))
    packed = build.archive({"models/box.gltf": gltf, f"models/{name}": data})
    assert build.is_box(load_mesh(packed, "box.zip"))


def test_a_binary_gltf_may_have_pieces_too(tmp_path):
    gltf, data = build.gltf_in_pieces()
    glb = build.pack_glb_text(gltf, b"")
    assert build.is_box(load_mesh(glb, pieces={"box.bin": data}))
    (tmp_path / "box.bin").write_bytes(data)
    (tmp_path / "box.glb").write_bytes(glb)
    assert build.is_box(load_mesh(tmp_path / "box.glb"))


def test_a_piece_that_is_not_there_is_named(tmp_path):
    gltf, data = build.gltf_in_pieces()
    (tmp_path / "box.gltf").write_bytes(gltf)
    others = {"Box.bin": data, "below/box.bin": data}
    for source in (gltf, tmp_path / "box.gltf", build.archive({"a.gltf": gltf, "b/box.bin": data})):
        with pytest.raises(MalformedFile, match=r"box\.bin") as caught:
            load_mesh(source, pieces=others if source is gltf else None)
        assert fault(caught) == "external-reference"


def test_a_piece_that_is_too_short_is_cut_off():
    gltf, data = build.gltf_in_pieces()
    with pytest.raises(MalformedFile) as caught:
        load_mesh(gltf, pieces={"box.bin": data[:-1]})
    assert fault(caught) == "truncated"


@ELSEWHERE
def test_nothing_elsewhere_is_opened(uri, tmp_path):
    gltf, data = build.gltf_in_pieces(uri)
    folder = tmp_path / "folder" / "below"
    folder.mkdir(parents=True)
    for place in (tmp_path, folder.parent, folder):
        (place / "box.bin").write_bytes(data)
    (folder / "box.gltf").write_bytes(gltf)
    with pytest.raises(MalformedFile) as caught:
        load_mesh(folder / "box.gltf")
    assert fault(caught) in ("external-reference", "missing-data")
    with pytest.raises(MalformedFile):
        load_mesh(gltf, "gltf", pieces={str(uri): data, "box.bin": data, "../box.bin": data})


def test_links_are_followed_within_the_folder_alone(tmp_path):
    gltf, data = build.gltf_in_pieces("linked/box.bin")
    folder = tmp_path / "folder"
    folder.mkdir()
    (folder / "box.gltf").write_bytes(gltf)
    (folder / "real").mkdir()
    (folder / "real" / "box.bin").write_bytes(data)
    (folder / "linked").symlink_to("real")
    assert build.is_box(load_mesh(folder / "box.gltf"))
    (folder / "linked").unlink()
    (folder / "real").rename(tmp_path / "outside")
    (folder / "linked").symlink_to(tmp_path / "outside")
    with pytest.raises(MalformedFile) as caught:
        load_mesh(folder / "box.gltf")
    assert fault(caught) == "external-reference"


def test_a_pipe_or_folder_is_no_piece(tmp_path):
    gltf, _ = build.gltf_in_pieces()
    (tmp_path / "box.gltf").write_bytes(gltf)
    os.mkfifo(tmp_path / "box.bin")
    with pytest.raises(MalformedFile):
        load_mesh(tmp_path / "box.gltf")
    (tmp_path / "box.bin").unlink()
    (tmp_path / "box.bin").mkdir()
    with pytest.raises(MalformedFile):
        load_mesh(tmp_path / "box.gltf")


def test_pieces_are_limited(tmp_path):
    document, data = build.gltf_document()
    document["buffers"] = [{"byteLength": len(data), "uri": "a.bin"}, {"uri": "b.bin"}]
    (tmp_path / "box.gltf").write_text(json.dumps(document))
    (tmp_path / "a.bin").write_bytes(data)
    (tmp_path / "b.bin").write_bytes(data)
    enough = Limits(piece_bytes=2 * len(data), entries=2)
    assert build.is_box(load_mesh(tmp_path / "box.gltf", limits=enough))
    for limits in (Limits(piece_bytes=2 * len(data) - 1), Limits(entries=1)):
        with pytest.raises(LimitExceeded):
            load_mesh(tmp_path / "box.gltf", limits=limits)


def test_an_archive_lists_its_meshes_with_their_pieces():
    gltf, data = build.gltf_in_pieces()
    archive = MeshArchive(
        build.archive(
            {
                "b/box.gltf": gltf,
                "b/box.bin": data,
                "a.STL": build.stl_binary(),
                "../../out.obj": build.obj(),
                "/abs.ply": build.ply_ascii(),
                "notes.txt": "hello",
                "inner.zip": build.archive({"c.stl": build.stl_binary()}),
                "inner.3mf": build.threemf(),
                "scene.blend": b"x",
                "__MACOSX/a.STL": b"x",
                "b/._box.gltf": b"x",
                ".hidden/a.stl": b"x",
                "folder.obj/": b"",
            }
        ),
        Limits(),
    )
    assert archive.names == ["a.STL", "abs.ply", "b/box.gltf", "inner.3mf", "out.obj"]
    assert archive.others == ["scene.blend"]
    for name in archive.names:
        content = archive.read(name)
        pieces = archive.pieces(name, content)
        assert archive.size(name) == len(content)
        assert build.is_box(load_mesh(content, name, pieces=pieces))
        assert pieces == ({"box.bin": data} if name == "b/box.gltf" else {})


def test_an_archive_of_several_meshes_goes_to_a_batch_and_one_of_none_is_none():
    several = build.archive({f"{number}.stl": build.stl_binary() for number in range(9)})
    with pytest.raises(MalformedFile, match=r"9 meshes \('0\.stl', .*batch") as caught:
        load_mesh(several)
    assert fault(caught) == "several-meshes"
    for files in ({}, {"a.txt": "a"}, {"a.zip": build.archive({"a.stl": build.stl_binary()})}):
        with pytest.raises(MalformedFile) as caught:
            load_mesh(build.archive(files), "a.zip")
        assert fault(caught) == "no-meshes"
    with pytest.raises(UnknownFormat):
        load_mesh(build.archive({"a.stl": build.archive({"b.stl": build.stl_binary()})}))


@pytest.mark.parametrize("other", ["dir/a.obj", "dir//a.obj", "./dir/a.obj"])
def test_files_of_one_name_are_refused_and_others_read(other):
    """Also where two paths lead to one place."""
    unlike = "x" * len(other)
    files = {"dir/a.obj": build.obj(), unlike: "v", "b.stl": build.stl_binary()}
    packed = build.archive(files).replace(unlike.encode(), other.encode())
    archive = MeshArchive(packed, Limits())
    assert archive.names == ["b.stl", "dir/a.obj"]
    with pytest.raises(MalformedFile, match=r"several files named 'dir/a\.obj'") as caught:
        archive.read("dir/a.obj")
    assert fault(caught) == "repeated-name"
    assert build.is_box(load_mesh(archive.read("b.stl")))


def test_a_part_of_a_3mf_that_is_there_twice_is_refused():
    parts = {"3D/3dmodel.model": build.model_xml(build.mesh_xml()), "3D/3DMODEL.MODEL": "<model/>"}
    with pytest.raises(MalformedFile) as caught:
        load_mesh(build.threemf(parts))
    assert fault(caught) == "repeated-name"


def test_a_3mf_that_is_called_a_zip_is_read():
    assert build.is_box(load_mesh(build.threemf(), "box.zip"))


def test_an_archive_from_an_open_file(tmp_path):
    path = tmp_path / "a.zip"
    path.write_bytes(build.archive({"a.stl": build.stl_binary(), "b.obj": build.obj()}))
    with path.open("rb") as file:
        archive = MeshArchive(file, Limits())
        meshes = [load_mesh(archive.read(name), name) for name in archive.names]
    assert all(map(build.is_box, meshes))


def test_archives_are_limited():
    stl = build.stl_ascii()
    files = {"a.stl": stl, "b.stl": stl}
    archive = build.archive(files)
    limits = Limits(entries=2, unpacked_bytes=len(stl), unpacked_bytes_per_byte=10)
    read = MeshArchive(archive, limits)
    assert all(read.read(name) == stl for name in read.names)
    for changes in ({"entries": 1}, {"unpacked_bytes": len(stl) - 1}, {"directory_bytes": 90}):
        with pytest.raises(LimitExceeded):
            load_mesh(build.archive({"a.stl": stl, "b.txt": ""}), limits=Limits(**changes))
    packed = build.archive({"a.stl": stl + b"\n" * 100 * len(archive)})
    with pytest.raises(LimitExceeded) as caught:
        load_mesh(packed)
    assert caught.value.limit == "unpacked_bytes_per_byte"
    # Each file is bounded by itself.
    files = {f"{number}.stl": stl for number in range(9)}
    read = MeshArchive(build.archive(files), Limits(unpacked_bytes=len(stl)))
    assert [read.read(name) for name in read.names] == 9 * [stl]


@pytest.mark.parametrize("seed", range(40))
def test_damaged_archives_raise_nothing_but_mesh_errors(seed):
    gltf, data = build.gltf_in_pieces()
    archive = bytearray(build.archive({"box.gltf": gltf, "box.bin": data}))
    random = np.random.default_rng(seed)
    for place in random.integers(len(archive), size=3):
        archive[place] = random.integers(256)
    with suppress(MeshError):
        load_mesh(bytes(archive), "box.zip")
