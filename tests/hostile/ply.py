"""Hostile PLY."""

import struct

from tests.hostile.catalogue import Catalogue, replaced
from tests.model.loading import loading_builders as build

FILES = Catalogue("box.ply")

_BINARY, _ASCII = build.ply_binary(), build.ply_ascii()
_HEADER = _BINARY[: _BINARY.index(b"end_header\n") + 11]
_POINTS = b"".join(struct.pack("<3f", *point) for point in build.VERTICES)


def _binary(lists: bytes, faces: int, count="uchar", item="int") -> bytes:
    return build.ply_header("binary_little_endian", faces, count, item) + _POINTS + lists


def _before_vertices(element: bytes, content: bytes) -> bytes:
    """The box behind records of another element."""
    header = replaced(_HEADER, b"element vertex", element + b"element vertex")
    return header + content + _BINARY[len(_HEADER) :]


def _header(old: bytes, new: bytes) -> None:
    title = f"{new.decode() or 'nothing'} for {old.decode()}".replace("\n", " ")[:60]
    FILES.add(title, replaced(_BINARY, old, new), "bad-header")


_header(b"format binary_little_endian", b"format binary_middle_endian")
_header(b"face 12", b"face -12")
_header(b"face 12", b"face 1e3")
_header(b"vertex 8", b"vertex " + b"9" * 5000)
_header(b"float x", b"quad x")
_header(b"float x", b"float w")
_header(b"float x", b"list uchar float x")
_header(b"float y", b"float x")
_header(b"list uchar int vertex_indices", b"list uchar int")
_header(b"list uchar int vertex_indices", b"int vertex_indices")
_header(b"element vertex 8\n", b"")
_header(b"element vertex 8\n", b"element vertex 8\nelement vertex 8\n")
_header(b"list uchar int vertex_indices", b"list float int vertex_indices")
_header(b"list uchar int vertex_indices", b"list uchar float vertex_indices")
_header(b"end_header", b"end")

for _what in ("vertex", "face"):
    for _kind, _box in (("binary", _BINARY), ("ascii", _ASCII)):
        _old = {"vertex": b"vertex 8", "face": b"face 12"}[_what]
        _new = _what.encode() + b" 1000000000000"
        FILES.add(f"{_kind} of 10^12 {_what} records", replaced(_box, _old, _new), "truncated")
FILES.add("cut in the header", _HEADER[:100], "bad-header")
FILES.add("cut after the header", _HEADER, "truncated")
FILES.add("cut in the vertices", _BINARY[: len(_HEADER) + 50], "truncated")
FILES.add("cut in the faces", _BINARY[:-7], "truncated")
FILES.add("cut in the text", _ASCII[:-30], "truncated")
FILES.add("newlines alone", lambda: b"ply\n" + b"\n" * 4_000_000, "bad-header")
FILES.add(
    "100 000 properties",
    lambda: _before_vertices(b"element q 0\n" + b"property int a\n" * 100_000, b""),
    "bad-header",
)
FILES.add("10^17 records of nothing", _before_vertices(b"element q %d\n" % 10**17, b""), None)
FILES.add(
    "12 million lists of different lengths",
    lambda: _before_vertices(
        b"element q 3000\n" + b"property list uchar char a\n" * 4000,
        bytes(4000 * 2999) + b"\1\1" * 4000,
    ),
    None,
)
FILES.add("a list of 255 corners", _binary(b"\xff" + bytes(12), 1), "truncated")
FILES.add("a list of 2^32 corners", _binary(b"\xff" * 4 + bytes(12), 1, "uint"), "truncated")
FILES.add("a list of -1 corners", _binary(b"\xff" * 4 + bytes(12), 1, "int"), "bad-face")
FILES.add(
    "a later list of -1 corners",
    _binary(struct.pack("<4i", 3, 0, 1, 2) + b"\xff" * 4 + bytes(16), 2, "int"),
    "bad-face",
)
FILES.add(
    "a later list of 2^63 corners",
    _binary(struct.pack("<Q3i", 3, 0, 1, 2) + b"\xff" * 7 + b"\x7f" + bytes(16), 2, "uint64"),
    "truncated",
)
FILES.add(
    "a polygon of 11 million corners",
    lambda: _binary(struct.pack("<I", 11_000_000) + bytes(11_000_000), 1, "uint", "uchar"),
    "too-many-faces",
)
FILES.add("lists of no corners", _binary(bytes(12), 12), "no-faces")
FILES.add("points alone", build.ply_binary([]), "no-faces")
FILES.add(
    "points without a face element",
    _HEADER[: _HEADER.index(b"element face")] + b"end_header\n" + _POINTS,
    "no-faces",
)
FILES.add("index -1", _binary(struct.pack("<B3i", 3, 0, 1, -1), 1), "index-out-of-range")
FILES.add("index past the end", _binary(struct.pack("<B3i", 3, 0, 1, 8), 1), "index-out-of-range")
FILES.add(
    "index 2^64 - 1",
    _binary(struct.pack("<B3Q", 3, 0, 1, 2**64 - 1), 1, item="uint64"),
    "index-out-of-range",
)
FILES.add("NaN", _BINARY.replace(struct.pack("<f", 2), b"\xff" * 4), "non-finite-vertices")
FILES.add("infinite", replaced(_ASCII, b"\n1.0 ", b"\n-inf "), "non-finite-vertices")
FILES.add(
    "past all floats",
    _ASCII.replace(b"1.0 ", b"1.7e308 ").replace(b"\n0.0", b"\n-1.7e308"),
    "extent-overflow",
)
FILES.add("all in one point", _HEADER + bytes(96) + _BINARY[len(_HEADER) + 96 :], "zero-extent")
FILES.add("index 0.5", replaced(_ASCII, b"\n3 0 2 3", b"\n3 0.5 2 3"), "bad-index")
FILES.add("words", replaced(_ASCII, b"\n3 0 2 3", b"\n3 zero 2 3"), "bad-number")
FILES.add("an underscore", replaced(_ASCII, b"\n3 0 2 3", b"\n3 0 2 0_3"), "bad-number")
FILES.add("text of zero bytes", replaced(_ASCII, b"\n3 0 2 3", b"\n3 0\0 2 3"), "not-text")
FILES.add("a line of 4 MB", lambda: _ASCII + b"1 " * 2_000_000, None)
FILES.add(
    "strips that end where they begin",
    build.ply_ascii([[-1] * 20, [0, -1, 1, -1], [0, 1, -1, 2]]).replace(b" face", b" tristrips"),
    "no-faces",
)
FILES.add(
    "a texture of another folder",
    replaced(_ASCII, b"a box", b"TextureFile ../../../etc/passwd"),
    None,
)
FILES.add("UTF-16", _ASCII.decode().encode("utf-16"), None)
