"""OBJ, OFF and STL: ordinary files load right, and traps are right or refused."""

import struct

import loading_builders as build
import numpy as np
import pytest

from meshconv3d.model.errors import MalformedFile, UnknownFormat, UnusableMesh
from meshconv3d.model.loading import load_mesh

TEXTS = pytest.mark.parametrize(
    ("extension", "data"),
    [pair for name, pair in build.SPELLINGS.items() if pair[0] == "obj" or "off" in name]
    + [build.SPELLINGS["stl ascii"], build.SPELLINGS["ply ascii"]],
)


@TEXTS
@pytest.mark.parametrize("end", [b"\r\n", b"\r"])
@pytest.mark.parametrize("mark", [b"", b"\xef\xbb\xbf"])
@pytest.mark.parametrize("tail", [b"", b"\n\n", b"\0\0\0", b"\x1a"])
def test_line_ends_byte_order_marks_and_padding(extension, data, end, mark, tail):
    assert build.is_box(load_mesh(mark + data.replace(b"\n", end) + tail, extension))
    assert build.is_box(load_mesh(mark + data.replace(b"\n", end) + tail))


def test_obj_relative_indices_count_from_their_own_line():
    boxes = []
    for shift in (0, 10, 20):
        moved = build.VERTICES + np.array([shift, 0, 0])
        boxes.append(build.rows(moved, "v ") + build.rows(build.FACES - 8, "f "))
    mesh = load_mesh("".join(boxes).encode(), "obj")
    assert len(mesh.faces) == 36
    assert build.is_box(mesh, boxes=3)
    assert mesh.vertices[:, 0].max() == 21


def test_obj_relative_and_absolute_indices_mix():
    text = build.obj().replace(b"f 1 3 4", b"f 1 -6 -5")
    assert build.is_box(load_mesh(text, "obj"))


@pytest.mark.parametrize("reference", ["0", "-0", "9", "-9", "999999999999999999"])
def test_obj_references_to_no_vertex_are_refused(reference):
    text = build.obj().replace(b"f 1 3 4", f"f {reference} 3 4".encode())
    with pytest.raises(UnusableMesh, match="begin at 1") as caught:
        load_mesh(text, "obj")
    assert caught.value.fault == "index-out-of-range"


def test_obj_vertices_of_two_numbers_are_refused():
    flat = build.rows(build.VERTICES[:, :2], "v ") + "f 1 2 3\n"
    for text in (flat, flat.replace("v 0.0 0.0\n", "v 0.0 0.0 0.0\n", 1)):
        with pytest.raises(MalformedFile, match="three numbers"):
            load_mesh(text.encode(), "obj")


@pytest.mark.parametrize(
    "bad", ["v 1,5 2 3", "v one two three", "v ", "f 1 2 x", "f 1 2 3.5", "f /1 2 3"]
)
def test_obj_words_in_place_of_numbers_are_refused(bad):
    with pytest.raises(MalformedFile):
        load_mesh(build.obj() + bad.encode() + b"\n", "obj")


@pytest.mark.parametrize("corner", ["{}/1", "{}//1", "{}/1/1", "{}/", "{}/-1/-1"])
def test_obj_textures_and_normals_are_passed_over(corner):
    faces = "".join(
        "f " + " ".join(corner.format(index + 1) for index in quad) + "\n" for quad in build.QUADS
    )
    text = build.rows(build.VERTICES, "v ") + "vt 0 0\nvn 0 0 1\n" + faces
    assert build.is_box(load_mesh(text.encode(), "obj"))


def test_obj_faces_of_any_kind_mix():
    text = (
        build.rows(build.VERTICES, "v ")
        + "vt 0 0\nvn 0 0 1\n"
        + "f 1 3 4 2\nf 5/1 6/1 8/1\nf 5//1 8//1 7//1\nl 1 2\nf 1 2\n"
        + build.rows(build.QUADS[2:] + 1, "f ")
    )
    mesh = load_mesh(text.encode(), "obj")
    assert len(mesh.faces) == 12
    assert build.is_box(mesh)


def test_obj_colours_weights_comments_names_and_continued_lines():
    vertices = [
        f"v {x} {y} {z}{' 1' if x else ' 0.5 0.5 0.5'} # corner\n" for x, y, z in build.VERTICES
    ]
    text = (
        "# caf\xe9\nmtllib caf\xe9.mtl\no v 1 2 3\n"
        + "".join(vertices)
        + "usemtl f 1 2 3\ng a b\ns off\n"
        + "  f\t1 3 \\\n4 2\n"
        + build.rows(build.QUADS[1:] + 1, "f ")
    )
    assert build.is_box(load_mesh(text.encode("latin-1"), "obj"))


@pytest.mark.parametrize("line", ["# C:\\models\\", "g parts\\box\\", "mtllib C:\\", "l 1 2 # a\\"])
def test_obj_lines_that_no_other_continues(line):
    vertices, _, faces = build.obj().partition(b"f ")
    for text in (b"%s\n" + vertices + b"f " + faces, vertices + b"%s\nf " + faces):
        mesh = load_mesh(text % line.encode(), "obj")
        assert (len(mesh.faces), build.area(mesh)) == (12, pytest.approx(build.AREA))


def test_obj_lines_that_are_continued_more_than_once():
    text = build.rows(build.VERTICES, "v ").replace(" 0.0 0.0\n", " \\\n0.0\\\n 0.0\n", 1)
    faces = build.rows(build.QUADS + 1, "f ").replace(" ", " \\\n ")
    assert build.is_box(load_mesh((text + faces + "f 1 2\\").encode(), "obj"))


@pytest.mark.parametrize(
    "word", ["1.#INF", "-1.#IND", "1#", "0x1", "1_0", "1e", ".", "+-1", "1..2"]
)
@pytest.mark.parametrize(
    "data", [build.obj(), build.off(), build.stl_ascii(), build.ply_ascii()], ids=len
)
def test_words_that_only_begin_like_a_number(data, word):
    with pytest.raises(MalformedFile) as caught:
        load_mesh(data.replace(b"2.0 3.0", b"2.0 " + word.encode(), 1))
    assert caught.value.fault == "bad-number"
    assert word in str(caught.value)


def test_obj_of_many_materials():
    faces = "".join(f"usemtl m{n}\nf 1 2 3\n" for n in range(60_000))
    mesh = load_mesh((build.rows(build.VERTICES, "v ") + faces).encode(), "obj")
    assert len(mesh.faces) == 60_000


@pytest.mark.parametrize(
    ("extension", "data"),
    [(name, data) for name, data in build.SPELLINGS.values() if b"\0" not in data],
)
def test_utf16_with_its_mark(extension, data):
    for encoding in ("utf-16-le", "utf-16-be"):
        changed = ("\ufeff" + data.decode()).encode(encoding)
        assert build.is_box(load_mesh(changed, extension))
        assert build.is_box(load_mesh(changed))


def test_zero_bytes_are_refused():
    with pytest.raises(MalformedFile, match="zero"):
        load_mesh(build.obj().replace(b"f 1 3", b"f\x001 3"), "obj")


def test_off_of_one_token_a_line():
    for header in ("OFF", "NOFF"):
        text = build.off(header="OFF").decode()
        if header == "NOFF":
            text = _with_columns("NOFF", 3)
        assert build.is_box(load_mesh("\n".join(text.split()).encode(), "off"))
        assert build.is_box(load_mesh((header + text[len(header) :].replace("\n", " ")).encode()))


@pytest.mark.parametrize(
    ("header", "columns"), [("COFF", 4), ("COFF", 3), ("NOFF", 3), ("CNOFF", 7), ("STOFF", 2)]
)
def test_off_with_colours_normals_and_textures(header, columns):
    assert build.is_box(load_mesh(_with_columns(header, columns).encode(), "box.off"))


def _with_columns(header: str, columns: int) -> str:
    vertices = np.hstack([build.VERTICES, np.full((8, columns), 0.5)])
    counted = [(len(face), *face) for face in build.QUADS]
    return f"{header}\n8 6 0\n" + build.rows(vertices) + build.rows(counted)


def test_off_with_comments_face_colours_and_mixed_polygons():
    text = (
        "# caf\xe9\nOFF # box\n\n8 7 # no edges\n"
        + build.rows(build.VERTICES)
        + "\n3 0 2 3 255 0 0 # red\n3 0 3 1 0.5 0.5 0.5 1\n"
        + build.rows([(4, *quad) for quad in build.QUADS[1:]])
    )
    assert build.is_box(load_mesh(text.encode("latin-1"), "off"))
    assert build.is_box(load_mesh(text.encode("latin-1")))


def test_off_counts_on_the_line_of_the_keyword():
    for between in (b" ", b"", b" # box\n# counts\n"):
        for name in (None, "box.off"):
            assert build.is_box(load_mesh(build.off().replace(b"OFF\n", b"OFF" + between, 1), name))
            colours = _with_columns("COFF", 4).encode()
            assert build.is_box(load_mesh(colours.replace(b"COFF\n", b"COFF" + between, 1), name))
    assert build.is_box(load_mesh(build.off()[4:], "off"))
    assert build.is_box(load_mesh(build.off().replace(b"8 12 0", b"8 12"), "off"))


@pytest.mark.parametrize(("header", "columns"), [("OFF", 0), ("CNOFF", 7), ("STOFF", 2)])
def test_binary_off(header, columns):
    vertices = np.hstack([build.VERTICES, np.ones((8, columns))]).astype(">f4").tobytes()
    coloured = b"".join(
        struct.pack(">6i2f", 4, *face, 2, 0.5, 1) if face[0] else struct.pack(">6i", 4, *face, 0)
        for face in build.QUADS
    )
    data = f"{header} BINARY\n".encode() + struct.pack(">3i", 8, 6, 12) + vertices + coloured
    assert build.is_box(load_mesh(data))
    assert load_mesh(data + bytes(9)).note == ""
    assert "5 bytes" in load_mesh(data + b"12345").note
    with pytest.raises(MalformedFile, match="ends before the last"):
        load_mesh(data[:-1])


@pytest.mark.parametrize("header", ["4OFF", "nOFF", "4nOFF"])
def test_off_of_other_kinds_is_refused_by_name(header):
    with pytest.raises(MalformedFile, match="export"):
        load_mesh(build.off(header=header), "off")


def test_more_than_the_header_declares_is_told():
    for data in (build.off(), build.ply_ascii(), build.ply_binary()):
        assert load_mesh(data).note == ""
        fewer = data.replace(b"face 12", b"face 11").replace(b"8 12 0", b"8 11 0")
        mesh = load_mesh(fewer)
        assert len(mesh.faces) == 11
        assert "goes on" in mesh.note


@pytest.mark.parametrize("index", [-1, 8])
def test_indices_outside_are_refused_and_never_wrap(index):
    faces = build.FACES.copy()
    faces[5, 1] = index
    model = build.model_xml(build.mesh_xml(faces))
    for data in (
        build.off(faces),
        build.ply_ascii(faces),
        build.ply_binary(faces),
        build.threemf({"3D/3dmodel.model": model}),
    ):
        with pytest.raises(UnusableMesh) as caught:
            load_mesh(data)
        assert caught.value.fault == "index-out-of-range"


def test_counts_beyond_the_bytes_are_refused_at_once():
    huge = str(10**12)
    for data in (
        build.off().replace(b"8 12 0", f"8 {huge} 0".encode()),
        build.off().replace(b"8 12 0", f"{huge} 12 0".encode()),
        build.ply_ascii().replace(b"face 12", f"face {huge}".encode()),
        build.ply_binary().replace(b"vertex 8", f"vertex {huge}".encode()),
        b"\0" * 80 + b"\xff\xff\xff\xff" + b"\0" * 100,
    ):
        with pytest.raises(MalformedFile) as caught:
            load_mesh(data, "stl" if data.startswith(b"\0") else None)
        assert caught.value.fault == "truncated"


@pytest.mark.parametrize("tail", [b"\0", b"\n", b"\r\n", b"written by a CAD program", bytes(100)])
def test_binary_stl_with_trailing_bytes(tail):
    mesh = load_mesh(build.stl_binary() + tail, "stl")
    assert len(mesh.faces) == 12
    assert build.is_box(mesh)
    assert mesh.note == ""


@pytest.mark.parametrize("count", [0, 1, 11])
def test_binary_stl_whose_count_is_too_small(count):
    data = bytearray(build.stl_binary(b"solid"))
    data[80:84] = struct.pack("<I", count)
    mesh = load_mesh(bytes(data), "stl")
    assert build.is_box(mesh)
    assert f"declares {count} triangles" in mesh.note
    assert "all were read" in mesh.note
    # What follows is no list of triangles then, so the count is believed where there is one.
    longer = load_mesh(bytes(data) + b"made by hand", "stl")
    assert len(longer.faces) == (count or 12)
    assert ("not read" in longer.note) == (count > 0)


@pytest.mark.parametrize("header", [b"solid box", b"ply\n", b"OFF\n", b"v 1 2 3", b"{", b"\xe9"])
def test_binary_stl_whose_header_spells_something_else(header):
    assert build.is_box(load_mesh(build.stl_binary(header), "stl"))
    assert build.is_box(load_mesh(build.stl_binary(header)))


def test_binary_stl_that_begins_with_solid_and_is_cut_off():
    with pytest.raises(MalformedFile, match="cut off"):
        load_mesh(build.stl_binary(b"solid box")[:-1], "stl")


@pytest.mark.parametrize("name", ["", "vertex 1 2 3", "caf\xe9", "endsolid facet"])
def test_ascii_stl_of_any_name_and_case(name):
    data = build.stl_ascii(name)
    assert build.is_box(load_mesh(data, "stl"))
    assert build.is_box(load_mesh(data.upper(), "stl"))


def test_ascii_stl_of_several_solids():
    assert build.is_box(load_mesh(2 * build.stl_ascii(), "stl"), boxes=2)


@pytest.mark.parametrize("blank", [b" ", b"\t\n \n", b"\r\n"])
@pytest.mark.parametrize("name", ["", "box of 3", "caf\xe9"])
def test_ascii_stl_in_free_form(name, blank):
    data = build.stl_ascii(name)
    for free in (
        blank.join(data.split()),
        data.replace(b"normal 0 0 0\n", b"\n"),
        data.replace(b"normal 0 0 0\n  outer loop", b""),
    ):
        assert build.is_box(load_mesh(free, "stl"))
        assert build.is_box(load_mesh(free.replace(b"endfacet", b"end facet") + b" 7", "stl"))


def test_ascii_stl_of_other_than_triangles():
    corner = b"    vertex 0.0 0.0 0.0\n"
    for data in (
        build.stl_ascii().replace(corner, 2 * corner, 1),
        build.stl_ascii().replace(corner, b""),
    ):
        with pytest.raises(MalformedFile, match="three vertices"):
            load_mesh(data, "stl")


def test_ascii_stl_without_its_end_is_cut_off():
    with pytest.raises(MalformedFile, match="endsolid"):
        load_mesh(build.stl_ascii().partition(b"endsolid")[0], "stl")


def test_text_that_is_no_stl():
    with pytest.raises((MalformedFile, UnknownFormat)):
        load_mesh(b"a letter to a friend\n" * 10, "stl")
