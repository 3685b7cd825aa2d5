"""OFF, as text or binary, with prefixes that keep three coordinates (COFF, NOFF, STOFF, ...)."""

import re
from codecs import BOM_UTF8

import numpy as np

from meshconv3d.model.errors import MalformedFile
from meshconv3d.model.loading.limits import Limits
from meshconv3d.model.loading.records import (
    Element,
    Field,
    Table,
    note_of_more,
    read_binary,
    read_text,
)
from meshconv3d.model.loading.text import plain_text
from meshconv3d.model.loading.triangles import NotedTriangles, triangulate

_SPACE = rb"(?:\s|(?<!\S)#[^\r\n]*)*+"
_KEYWORD = re.compile(_SPACE + rb"((ST)?(C)?(N)?(4)?(n)?OFF(?=[\s\d]))?")
_BINARY = re.compile(rb"[ \t]*BINARY\b[^\n]*\n")
_COUNT = _SPACE + rb"(\d{1,18})(?!\S)"
# The count of edges is left out by some writers, who then end the line.
_COUNTS = re.compile(_COUNT + rb"[ \t]+(\d{1,18})(?!\S)[ \t]*(?:(?=[\n#])|\d+(?!\S))")
_SPREAD_COUNTS = re.compile(_COUNT + _COUNT + _COUNT)
_INTEGER, _FLOAT = np.dtype(">i4"), np.dtype(">f4")
_CORNERS = Field("corners", _INTEGER, _INTEGER)
_WANTED = {"vertex": ("x", "y", "z"), "face": ("corners",)}


def read_off(data: bytes, limits: Limits) -> NotedTriangles:
    """The triangles of an OFF file. Raises MalformedFile and LimitExceeded."""
    data = data.removeprefix(BOM_UTF8)
    keyword = _KEYWORD.match(data)
    assert keyword is not None  # every part of the pattern is optional
    if keyword[5] or keyword[6]:
        raise MalformedFile(
            "unsupported-feature",
            f"{keyword[1].decode()} has vertices of other than three coordinates; export plain OFF",
        )
    # Numbers behind the coordinates of a vertex: texture 2, colour 4, normal 3.
    extra = 2 * bool(keyword[2]) + 4 * bool(keyword[3]) + 3 * bool(keyword[4])
    binary = _BINARY.match(data, keyword.end())
    if binary and keyword[1]:
        tables, note = _read_binary(data, binary.end(), extra, limits)
    else:
        tables, note = _read_text(plain_text(data[keyword.end() :]), extra, limits)
    vertices, (_, corners, counts) = tables["vertex"].numbers, tables["face"]
    return vertices, triangulate(vertices, corners, counts, limits), note


def _read_binary(
    data: bytes, place: int, extra: int, limits: Limits
) -> tuple[dict[str, Table], str]:
    """Tables and note of big-endian numbers from a place on."""
    counts = np.frombuffer(data[place : place + 12].ljust(12, b"\xff"), _INTEGER)[:2]
    if (counts < 0).any():
        raise MalformedFile(
            "bad-header", "a binary OFF file begins with the counts of vertices, faces and edges"
        )
    vertices, faces = counts.tolist()
    colour = Field("colour", _FLOAT, _INTEGER)
    elements = (_vertex(vertices, extra), Element("face", faces, (_CORNERS, colour)))
    tables, place = read_binary(data, place + 12, elements, _WANTED, limits)
    return tables, note_of_more(data, place)


def _read_text(text: bytes, extra: int, limits: Limits) -> tuple[dict[str, Table], str]:
    """Tables and note of the text after the keyword: lines of vertices and faces, or a stream."""
    counts = _COUNTS.match(text) or _SPREAD_COUNTS.match(text)
    if counts is None:
        raise MalformedFile(
            "bad-header",
            "an OFF file begins with the word OFF and the counts of vertices, faces and edges",
        )
    # In a stream, a face cannot have a colour behind it.
    elements = (_vertex(int(counts[1]), extra), Element("face", int(counts[2]), (_CORNERS,)))
    tables, place = read_text(text, counts.end(), elements, _WANTED, limits, comments=True)
    return tables, note_of_more(text, place)


def _vertex(count: int, extra: int) -> Element:
    """The element of vertices with `extra` numbers behind their coordinates."""
    names = (*"xyz", *map(str, range(extra)))
    return Element("vertex", count, tuple(Field(name, _FLOAT) for name in names))
