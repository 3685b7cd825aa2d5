"""PLY: mixed polygons, further properties and elements, header variants."""

import struct

import loading_builders as build
import numpy as np
import pytest

from meshconv3d.model.errors import MalformedFile
from meshconv3d.model.loading import load_mesh

MIXED = [tuple(build.QUADS[0]), *map(tuple, build.FACES[[1, 7]]), *map(tuple, build.QUADS[2:])]


@pytest.mark.parametrize("order", ["<", ">"])
def test_mixed_triangles_and_quads(order):
    for data in (build.ply_binary(MIXED, order), build.ply_ascii(MIXED)):
        mesh = load_mesh(data, "ply")
        assert len(mesh.faces) == 12
        assert build.is_box(mesh)


def test_a_face_of_equal_width_but_other_meaning():
    # As rows of four numbers these are alike: "3 a b c" + flag against "2 a b" + flag + ...
    text = (
        build.ply_ascii(build.QUADS)
        .decode()
        .replace("end_header", "property uchar flag\nend_header")
    )
    head, _, body = text.partition("end_header\n")
    lines = body.splitlines()
    faces = [line + " 7" for line in lines[8:]]
    mixed = "\n".join(lines[:8] + faces) + "\n"
    assert build.is_box(load_mesh((head + "end_header\n" + mixed).encode(), "ply"))


@pytest.mark.parametrize("tail", [b"\0", b"\n", b"trailing"])
def test_binary_with_trailing_bytes(tail):
    assert build.is_box(load_mesh(build.ply_binary() + tail, "ply"))
    assert build.is_box(load_mesh(build.ply_binary(MIXED) + tail, "ply"))


def test_further_elements_and_properties_are_passed_over():
    header = (
        "ply\r\nformat binary_big_endian 1.0\r\nobj_info caf\xe9\r\n"
        "element camera 2\r\nproperty list ushort double pose\r\nproperty char id\r\n"
        "element vertex 8\r\nproperty uchar red\r\nproperty double x\r\nproperty double y\r\n"
        "property double z\r\nproperty float u\r\nproperty float v\r\n"
        "element face 12\r\nproperty list uchar float texcoord\r\n"
        "property list int uint vertex_index\r\nproperty short flags\r\n"
        "element edge 1\r\nproperty int vertex1\r\nproperty int vertex2\r\nend_header\r\n"
    ).encode("latin-1")
    cameras = struct.pack(">H2db", 2, 1.5, 2.5, 1) + struct.pack(">Hb", 0, 2)
    vertices = b"".join(struct.pack(">B3d2f", 9, *point, 0, 0) for point in build.VERTICES)
    faces = b"".join(struct.pack(">B6fi3Ih", 6, *[0.5] * 6, 3, *f, -1) for f in build.FACES)
    data = header + cameras + vertices + faces + struct.pack(">2i", 0, 1)
    mesh = load_mesh(data, "ply")
    assert build.is_box(mesh)
    assert len(mesh.vertices) == 8


def test_faces_before_vertices():
    head, _, rest = build.ply_ascii().partition(b"element vertex")
    vertex, _, rest = (b"element vertex" + rest).partition(b"element face")
    face, _, body = (b"element face" + rest).partition(b"end_header\n")
    lines = body.splitlines(keepends=True)
    data = head + face + vertex + b"end_header\n" + b"".join(lines[8:] + lines[:8])
    assert build.is_box(load_mesh(data, "ply"))


def test_lone_carriage_returns_in_a_binary_header():
    header, _, body = build.ply_binary().partition(b"end_header\n")
    vertices = np.frombuffer(body[:96], "<f4")
    assert vertices.tobytes()[0] == 0
    for first in (b"", b"\n"):  # data that begins with a byte that looks like a line end
        moved = first + body[len(first) :]
        data = header.replace(b"\n", b"\r") + b"end_header\r" + moved
        mesh = load_mesh(data, "ply")
        assert build.volume(mesh) == pytest.approx(build.VOLUME)


@pytest.mark.parametrize(
    ("old", "new"),
    [
        (b"format", b"farmat"),
        (b"float x", b"quad x"),
        (b"float x", b"float w"),
        (b"face 12", b"face many"),
        (b"face 12", b"face -12"),
        (b"end_header", b"end"),
        (b"vertex_indices", b""),
        (b"element vertex 8\n", b""),
    ],
)
def test_headers_that_make_no_sense(old, new):
    for data in (build.ply_ascii(), build.ply_binary()):
        with pytest.raises(MalformedFile):
            load_mesh(data.replace(old, new), "ply")


def test_indices_that_are_no_whole_numbers():
    text = build.ply_ascii().replace(b"\n3 0 2 3\n", b"\n3 0 2.5 3\n")
    with pytest.raises(MalformedFile, match="whole numbers"):
        load_mesh(text, "ply")


def test_triangle_strips():
    # Around the box, its bottom, its top; between them, what is no strip.
    strips = [4, 0, 5, 1, 7, 3, 6, 2, 4, 0, -1, 0, 2, 1, 3, -1, -1, 7, -1, 4, 5, 6, 7]
    for lists in ([strips], [strips[:10], strips[11:16], [], strips[16:]]):
        for data in (build.ply_ascii(lists), build.ply_binary(lists, ">")):
            mesh = load_mesh(data.replace(b"element face", b"element tristrips"), "ply")
            assert len(mesh.faces) == 12
            assert build.is_box(mesh)


def test_columns_that_nobody_wants_may_hold_anything():
    head, _, body = build.ply_ascii(MIXED).partition(b"end_header\n")
    head = head.replace(b"property float x", b"property float u\nproperty float x")
    head = head.replace(b"element face", b"property float nx\nelement face")
    lines = body.splitlines()
    vertices = [b"-nan(ind) " + line + b" nan(0x8) 1.#QNAN" for line in lines[:8]]
    faces = [line + b" 255 0 \xff # 3 4" for line in lines[8:]]
    for end in (b"\n", b"\r", b"\r\n"):
        data = head + b"end_header\n" + b"\n".join([*vertices, b"", *faces]) + b"\n"
        assert build.is_box(load_mesh(data.replace(b"\n", end), "ply"))


def test_numbers_without_regard_to_lines():
    for data in (build.ply_ascii(MIXED), build.ply_ascii()):
        head, _, body = data.partition(b"end_header\n")
        for blank in (b" ", b"\n"):
            assert build.is_box(load_mesh(head + b"end_header\n" + blank.join(body.split())))


@pytest.mark.parametrize("order", ["ascii", "<"])
def test_headers_are_split_at_line_ends_alone(order):
    data = build.ply_ascii() if order == "ascii" else build.ply_binary()
    for strange in (b"\x85", b"\x0b", b"\x0c", b"\x1c", b"\x1d", b"\x1e"):
        changed = data.replace(b"comment a box", b"comment a" + strange + b"element vertex 9")
        assert build.is_box(load_mesh(changed, "ply"))


@pytest.mark.parametrize(
    ("scalar", "code"), [("char", "b"), ("uint16", "H"), ("int", "i"), ("double", "d")]
)
@pytest.mark.parametrize(
    ("count", "width"), [("char", "b"), ("ushort", "H"), ("int32", "i"), ("uint64", "Q")]
)
def test_types_of_all_kinds(scalar, code, count, width):
    for order, name in (("<", "little"), (">", "big")):
        header = build.ply_header(f"binary_{name}_endian", len(MIXED), count, "uint")
        header = header.replace(b"float", scalar.encode())
        points = b"".join(
            struct.pack(f"{order}3{code}", *map(int, p))
            if code != "d"
            else struct.pack(f"{order}3d", *p)
            for p in build.VERTICES
        )
        lists = b"".join(
            struct.pack(f"{order}{width}{len(face)}I", len(face), *face) for face in MIXED
        )
        assert build.is_box(load_mesh(header + points + lists, "ply"))
