"""Meshes that come in several files, and archives, on a running service."""

from dataclasses import asdict

import httpx
import pytest

from meshconv3d.model.loading import TABLE
from tests.model.loading import loading_builders as build
from tests.service.conftest import LIMIT
from tests.service.test_http_batch import form, lines_of
from tests.service.test_http_classify import result_of
from tests.service.test_http_problems import problem_of

GLTF, DATA = build.gltf_in_pieces("buffers/my%20box.bin")
BOX = ("box.glb", build.glb())


def faces(line: dict) -> int:
    return line["mesh"]["faces_in"]


@pytest.mark.parametrize("name", ["buffers/my box.bin", "my box.bin"])
def test_a_gltf_comes_with_its_buffers(client: httpx.Client, name: str) -> None:
    expected = result_of(client.post("/v1/classify", files=form(BOX)))
    pieces = ("box.gltf", GLTF), (name, DATA), ("skin.png", b"\x89PNG"), ("notes", b"")
    for files in (pieces, pieces[::-1]):
        response = client.post("/v1/classify", files=form(*files))
        assert result_of(response) == expected
        assert response.json()["file"] == "box.gltf"
    (line,) = lines_of(client.post("/v1/classify/batch", files=form(*pieces[:2])))
    assert faces(line) == 12
    coloured = {"accept": "model/gltf-binary"}
    explained = client.post("/v1/explain", files=form(*pieces), headers=coloured)
    assert explained.content.startswith(b"glTF")


def test_a_gltf_without_its_buffer_says_which_it_misses(client: httpx.Client) -> None:
    for files in ([("box.gltf", GLTF)], [("box.gltf", GLTF), ("other.bin", DATA)]):
        found = problem_of(client.post("/v1/classify", files=form(*files)), 400)
        assert found["fault"] == "external-reference"
        assert "buffers/my box.bin" in found["detail"]


def test_files_of_one_name_are_told_apart_by_their_folders(client: httpx.Client) -> None:
    gltf, data = build.gltf_in_pieces("box.bin")
    files = [
        ("a/box.gltf", gltf),
        ("b/box.gltf", gltf),
        ("b/box.bin", bytes(len(data))),
        ("a/box.bin", data),
    ]
    first, second = lines_of(client.post("/v1/classify/batch", files=form(*files)))
    assert faces(first) == 12
    assert second["error"]["fault"] == "zero-extent"
    bare = [(name.partition("/")[2], content) for name, content in files]
    lines = lines_of(client.post("/v1/classify/batch", files=form(*bare)))
    assert "several files named 'box.bin'" in lines[0]["error"]["message"]


def test_two_meshes_are_no_mesh_with_a_piece(client: httpx.Client) -> None:
    response = client.post("/v1/classify", files=form(BOX, ("a.obj", build.obj())))
    assert problem_of(response, 413)["fault"] == "too-many-meshes"
    many = form(BOX, *((f"{number}.bin", b"") for number in range(101)))
    assert problem_of(client.post("/v1/classify", files=many), 413)["fault"] == "too-many-meshes"


def test_an_archive_of_one_mesh_is_that_mesh(client: httpx.Client) -> None:
    expected = result_of(client.post("/v1/classify", files=form(BOX)))
    packed = build.archive({"a/box.gltf": GLTF, "a/buffers/my box.bin": DATA, "read me": "x"})
    assert result_of(client.post("/v1/classify", files=form(("a.zip", packed)))) == expected
    raw = client.post("/v1/classify", content=packed, headers={"content-type": "application/zip"})
    assert result_of(raw) == expected


def test_an_archive_of_several_meshes_goes_to_the_batch(client: httpx.Client) -> None:
    packed = build.archive({"a.stl": build.stl_binary(), "b/c.obj": build.obj(), "d.obj": "v 0"})
    found = problem_of(client.post("/v1/classify", files=form(("a.zip", packed))), 400)
    assert found["fault"] == "several-meshes"
    assert "/v1/classify/batch" in found["detail"]
    files = form(
        ("a.zip", packed), BOX, ("bad.zip", b"PK\3\4"), ("box.gltf", GLTF), ("my box.bin", DATA)
    )
    lines = lines_of(client.post("/v1/classify/batch", files=files))
    assert [line["file"] for line in lines] == [
        *("a.zip/a.stl", "a.zip/b/c.obj", "a.zip/d.obj"),
        *("box.glb", "bad.zip", "box.gltf"),
    ]
    assert [faces(line) for line in lines if "mesh" in line] == [12, 12, 12, 12]
    assert [line["error"]["fault"] for line in lines if "error" in line] == [
        "bad-vertex",
        "truncated",
    ]


def test_a_damaged_file_in_an_archive_costs_its_own_line(client: httpx.Client) -> None:
    packed = build.archive({"a.stl": build.stl_binary(), "b.obj": build.obj()})
    damaged = packed.replace(build.archive({"a.stl": build.stl_binary()})[35:60], bytes(25), 1)
    first, second = lines_of(client.post("/v1/classify/batch", files=form(("a.zip", damaged))))
    assert (first["file"], first["error"]["fault"]) == ("a.zip/a.stl", "truncated")
    assert faces(second) == 12


def test_an_archive_that_holds_too_much_costs_its_own_line(client: httpx.Client) -> None:
    """What is left of the places and bytes of a request is for the others."""
    many = build.archive({f"{number}.obj": build.obj() for number in range(200)})
    spaces = b" " * (LIMIT // 2 + 1)
    large = build.archive({"a.obj": build.obj() + spaces, "b.obj": build.obj() + spaces})
    two = build.archive({"a.obj": build.obj(), "b.stl": build.stl_binary()})
    files = form(("many.zip", many), ("large.zip", large), ("two.zip", two), BOX)
    lines = lines_of(client.post("/v1/classify/batch", files=files))
    assert [(line["file"], line.get("error", {}).get("fault")) for line in lines] == [
        ("many.zip", "too-many-meshes"),
        ("large.zip", "too-many-unpacked-bytes"),
        *(("two.zip/a.obj", None), ("two.zip/b.stl", None), ("box.glb", None)),
    ]


def test_files_of_one_name_in_an_archive_cost_their_own_line(client: httpx.Client) -> None:
    packed = build.archive({"a.obj": build.obj(), "x.obj": "v 0", "b.obj": build.obj()})
    packed = packed.replace(b"x.obj", b"a.obj")
    first, second = lines_of(client.post("/v1/classify/batch", files=form(("a.zip", packed))))
    assert (first["file"], first["error"]["fault"]) == ("a.zip/a.obj", "repeated-name")
    assert faces(second) == 12


def test_the_formats_are_those_that_are_read(client: httpx.Client) -> None:
    told = client.get("/v1/formats").json()["formats"]
    assert told == [asdict(known.row) for known in TABLE.values()]
