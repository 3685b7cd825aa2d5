"""Hostile STL."""

import struct

import numpy as np

from tests.hostile.catalogue import Catalogue, replaced
from tests.model.loading import loading_builders as build

FILES = Catalogue("box.stl")

_BINARY, _ASCII = build.stl_binary(), build.stl_ascii()
_RECORD = 84  # the first byte of the first triangle


def _with_count(count: int) -> bytes:
    return _BINARY[:80] + struct.pack("<I", count) + _BINARY[84:]


def _of_corners(*values: float) -> bytes:
    corners = np.resize(np.array(values, "<f4"), 9)
    return bytes(80) + struct.pack("<I", 1) + bytes(12) + corners.tobytes() + bytes(2)


FILES.add("a count of all ones", _with_count(2**32 - 1), "truncated")
FILES.add("a count of one too many", _with_count(13), "truncated")
FILES.add("a count of none", _with_count(0)[:84], "no-faces")
FILES.add("cut in the header", _BINARY[:40], "truncated")
FILES.add("cut in the count", _BINARY[:82], "truncated")
FILES.add("cut after the count", _BINARY[:_RECORD], "truncated")
FILES.add("cut in a triangle", _BINARY[: _RECORD + 75], "truncated")
FILES.add("cut at the last byte", _BINARY[:-1], "truncated")
FILES.add("cut and beginning with solid", build.stl_binary(b"solid box")[:-1], "truncated")
FILES.add("NaN", _of_corners(np.nan, 0, 1), "non-finite-vertices")
FILES.add("infinite", _of_corners(np.inf, 0, 1, 2), "non-finite-vertices")
FILES.add("the largest floats", _of_corners(3e38, 0, -3e38, 1, 2), None)
FILES.add("all in one point", _of_corners(7), "zero-extent")
FILES.add("text cut before its end", _ASCII[: _ASCII.index(b"endsolid")], "truncated")
FILES.add("text cut in a vertex", _ASCII[:100], "truncated")
FILES.add("text without triangles", b"solid a\nendsolid a\n", "no-faces")
FILES.add("text of two corners", replaced(_ASCII, b"    vertex 0.0 0.0 0.0\n", b""), "bad-face")
FILES.add("text of words", replaced(_ASCII, b"vertex 0.0", b"vertex zero"), "bad-number")
FILES.add("text in one line", _ASCII.replace(b"\n", b" "), None)
FILES.add(
    "text with an infinite number",
    replaced(_ASCII, b"vertex 0.0", b"vertex 1e400"),
    "non-finite-vertices",
)
FILES.add(
    "text past all floats",
    _ASCII.replace(b"1.0", b"1.7e308").replace(b" 0.0", b" -1.7e308"),
    "extent-overflow",
)
FILES.add("a name of 2 MB", lambda: build.stl_ascii("a" * 2_000_000), None)
FILES.add("20 000 solids of one name", lambda: b"".join(_solids(20_000)), None)
FILES.add(
    "a number of 500 000 digits",
    replaced(_ASCII, b"vertex 0.0", b"vertex 0." + b"1" * 500_000),
    None,
)
FILES.add("text as UTF-16", _ASCII.decode().encode("utf-16"), None)
FILES.add("a letter", b"a letter to a friend\n" * 10, "truncated")
FILES.add("only the word", b"solid", "truncated")


def _solids(count: int) -> list[bytes]:
    facet = _ASCII[_ASCII.index(b"facet") : _ASCII.index(b"endfacet")]
    return [b"solid same\n" + facet + b"endfacet\nendsolid same\n"] * count
