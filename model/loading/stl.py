"""STL, binary and ASCII."""

import numpy as np

from meshconv3d.model.errors import MalformedFile
from meshconv3d.model.jit import kernel
from meshconv3d.model.loading.limits import Limits
from meshconv3d.model.loading.text import (
    LOWER,
    convert,
    is_space,
    next_word,
    number,
    plain_text,
    quoted_line,
    word_end,
)
from meshconv3d.model.loading.triangles import NotedTriangles, Triangles, coordinates

_HEADER = 84  # bytes: 80 of any content, then the count of triangles
_RECORD = np.dtype([("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("attribute", "<u2")])

_OK, _CUT_OFF, _BAD_FACET = range(3)


def is_exact_binary(data: bytes) -> bool:
    """Whether the count in the header fits the length to the byte, as only binary STL does."""
    return len(data) >= _HEADER and _declared_length(data) == len(data)


def read_stl(data: bytes, limits: Limits) -> Triangles | NotedTriangles:
    """The triangles of an STL file, three vertices of their own each.

    Raises MalformedFile and LimitExceeded.
    """
    # "solid" at the start says nothing, many binary files have it. The count does: as text, its
    # four bytes would declare a file of more than seven gigabytes.
    if len(data) >= _HEADER and _declared_length(data) <= len(data):
        return _read_binary(data, limits)
    if _is_text(data):
        return _read_ascii(plain_text(data), limits)
    if len(data) < _HEADER:
        raise MalformedFile(
            "truncated",
            f"the file has {len(data)} bytes, but a binary STL has at least {_HEADER}; "
            "it is cut off, export or upload it again",
        )
    raise MalformedFile(
        "truncated",
        f"the header declares {_declared_count(data)} triangles, which is "
        f"{_declared_length(data)} bytes, but the file has {len(data)}; "
        "it is cut off, export or upload it again",
    )


def _read_binary(data: bytes, limits: Limits) -> NotedTriangles:
    declared = count = _declared_count(data)
    whole, rest = divmod(len(data) - _HEADER, _RECORD.itemsize)
    note = ""
    if whole > declared and len(data.rstrip(b"\0")) > _declared_length(data):
        # Writers that do not know the count beforehand leave 0, or what they expected.
        if not rest or not declared:
            count = whole
            note = (
                f"The STL header declares {declared} triangles, but {count} follow: all were read."
            )
        else:
            note = (
                f"The STL file goes on for {len(data) - _declared_length(data)} bytes after the "
                f"{declared} triangles that its header declares; they were not read."
            )
    limits.check("faces", count)
    limits.check("vertices", 3 * count)
    records = np.frombuffer(data, dtype=_RECORD, count=count, offset=_HEADER)
    vertices = coordinates(records["corners"].reshape(-1, 3))
    return vertices, np.arange(3 * count).reshape(-1, 3), note


def _declared_count(data: bytes) -> int:
    return int.from_bytes(data[80:84], "little")


def _declared_length(data: bytes) -> int:
    return _HEADER + _RECORD.itemsize * _declared_count(data)


def _is_text(data: bytes) -> bool:
    start = data[:1024]
    return b"solid" in start.lower() and b"\0" not in start.rstrip(b"\0")


def _read_ascii(text: bytes, limits: Limits) -> Triangles:
    # At least as many as there are; what of the array stays unused takes no memory.
    vertices = np.empty((len(text) // len("vertex 0 0 0 "), 3))
    ended, place, count = _scan(np.frombuffer(text, np.uint8), vertices)
    if ended == _CUT_OFF:
        raise MalformedFile(
            "truncated", "the text ends without 'endsolid'; it is cut off, export it again"
        )
    if ended == _BAD_FACET:
        raise MalformedFile(
            "bad-face",
            "each facet must have three vertices, unlike the one that ends in the line "
            f"{quoted_line(text, place)}; the file is damaged or was written wrongly",
        )
    limits.check("faces", count // 3)
    limits.check("vertices", count)
    convert(text, vertices[:count])
    return vertices[:count], np.arange(count).reshape(-1, 3)


@kernel
def _scan(text, vertices):
    """Fill in the vertices of all facets, up to the first that is wrong.

    White space is free, and the name of a solid is any words: outside of a facet, only the two
    words that begin one and the end of the solid count.

    vertices: as many rows as the text has words `vertex`, or more.

    Returns how the scan ended, where, and the number of vertices.
    """
    vertex = facets = 0
    inside, solid = False, True
    place = next_word(text, 0, False)
    while place < len(text):
        after = next_word(text, word_end(text, place), False)
        closes, ends = _is(text, place, b"endfacet"), _is(text, place, b"endsolid")
        if _is(text, place, b"end") and after < len(text):
            closes, ends = _is(text, after, b"facet"), _is(text, after, b"solid")
            after = next_word(text, word_end(text, after), False)
        opens = _is(text, place, b"facet") and (
            _is(text, after, b"normal") or _is(text, after, b"outer") or _is(text, after, b"vertex")
        )
        if opens or closes or ends:
            if vertex != 3 * facets:
                return _BAD_FACET, place, vertex
            inside, solid = opens, not ends
            facets += opens
        elif inside and _is(text, place, b"vertex"):
            if vertex == 3 * facets:
                return _BAD_FACET, place, vertex
            for axis in range(3):
                if after == len(text):
                    return _CUT_OFF, place, vertex
                vertices[vertex, axis], after = number(text, after)
                after = next_word(text, after, False)
            vertex += 1
        place = after
    return _CUT_OFF if solid or inside else _OK, place, vertex


@kernel
def _is(text, place, name):
    """Whether the word at a place is this name, in upper or lower case."""
    if place + len(name) >= len(text):
        return False
    for index in range(len(name)):
        if text[place + index] | LOWER != name[index]:
            return False
    return is_space(text[place + len(name)])
