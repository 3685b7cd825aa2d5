"""OFF, ASCII, with any of the prefixes that keep three coordinates (COFF, NOFF, STOFF, ...)."""

import re

import numpy as np
from numpy.typing import NDArray

from model.errors import MalformedFile
from model.loading.records import Element, Field, read_element
from model.loading.text import numbers, plain_text, points
from model.loading.triangles import Triangles, fan, indices

_KEYWORD = re.compile(rb"\s*((ST)?(C)?(N)?(4)?(n)?OFF\b)?[ \t]*(BINARY\b)?")
_FLOAT = np.dtype("<f8")


def read_off(data: bytes) -> Triangles:
    """The triangles of an OFF file. Raises MalformedFile."""
    text = re.sub(rb"#[^\n]*", b"", plain_text(data))
    keyword = _KEYWORD.match(text)
    assert keyword is not None  # every part of the pattern is optional
    _refuse_variants(keyword)
    body = text[keyword.end() :]
    counts, start = _counts(body)
    lines = [line for line in body[start:].split(b"\n") if line.strip()]
    if len(lines) >= sum(counts) and all(len(line.split()) > 2 for line in lines[:1]):
        return _read_lines(lines, *counts)
    return _read_stream(body[start:], *counts, extra=_extra_numbers(keyword))


def _refuse_variants(keyword: re.Match[bytes]) -> None:
    if keyword[5] or keyword[6]:
        raise MalformedFile(
            "unsupported-feature",
            f"{keyword[1].decode()} has vertices of other than three coordinates; export plain OFF",
        )
    if keyword[7]:
        raise MalformedFile("unsupported-feature", "binary OFF is not read; export it as text")


def _counts(body: bytes) -> tuple[tuple[int, int], int]:
    """The declared counts of vertices and faces, and where the data begins after them.

    The third number, the count of edges, is left out by some writers who then end the line.
    """
    found = re.match(rb"\s*(\d+)(\s+)(\d+)(?:[ \t]*\n|\s+\d+)", body)
    if found and b"\n" in found[2]:
        found = re.match(rb"\s*(\d+)(\s+)(\d+)\s+\d+", body)
    if found is None:
        raise MalformedFile(
            "bad-header",
            "an OFF file begins with the word OFF and the counts of vertices, faces and edges",
        )
    vertices, faces = int(found[1]), int(found[3])
    # "0 0 0\n" and "0\n" are the shortest vertex and face.
    if 6 * vertices + 2 * faces > len(body):
        raise MalformedFile(
            "truncated",
            f"the header declares {vertices} vertices and {faces} faces, more than "
            f"{len(body)} bytes can hold; the file is cut off, export or upload it again",
        )
    return (vertices, faces), found.end()


def _read_lines(lines: list[bytes], vertex_count: int, face_count: int) -> Triangles:
    """One vertex or face a line; normals, colours and textures behind them are passed over."""
    vertices = points(lines[:vertex_count], "vertex line")
    rows = lines[vertex_count : vertex_count + face_count]
    words = np.fromiter((len(row.split()) for row in rows), np.int64, len(rows))
    values = numbers(b" ".join(rows))
    starts = np.cumsum(words) - words
    counts = indices(values[starts])
    if (counts < 0).any() or (counts >= words).any():
        raise MalformedFile("bad-face", "a face line has fewer vertices than it declares")
    place = np.arange(len(values)) - np.repeat(starts, words)
    corners = values[(place > 0) & (place <= np.repeat(counts, words))]
    return vertices, fan(indices(corners), counts)


def _read_stream(body: bytes, vertex_count: int, face_count: int, extra: int) -> Triangles:
    """Numbers without regard to lines; then a face cannot have a colour behind it."""
    stream: NDArray[np.float64] = numbers(body)
    data = stream.astype(_FLOAT).tobytes()
    fields = tuple(Field(str(place), _FLOAT) for place in range(3 + extra))
    vertex, end = read_element(data, 0, Element("vertex", vertex_count, fields))
    corner = Field("corners", _FLOAT, _FLOAT)
    face, end = read_element(data, end, Element("face", face_count, (corner,)))
    if end != len(data):
        raise MalformedFile(
            "bad-face",
            "numbers are left over after the last face; write one vertex or face a line",
        )
    vertices = np.stack([vertex[str(axis)].values for axis in range(3)], axis=1)
    return vertices, fan(indices(face["corners"].values), face["corners"].counts)


def _extra_numbers(keyword: re.Match[bytes]) -> int:
    """Numbers behind the coordinates of a vertex: texture 2, colour 4, normal 3."""
    return 2 * bool(keyword[2]) + 4 * bool(keyword[3]) + 3 * bool(keyword[4])
