"""OFF, ASCII, with any of the prefixes that keep three coordinates (COFF, NOFF, STOFF, ...)."""

import re

import numpy as np
from numpy.typing import NDArray

from meshconv3d.model.errors import MalformedFile
from meshconv3d.model.loading.elements import Element, Field
from meshconv3d.model.loading.limits import Limits
from meshconv3d.model.loading.records import read_element
from meshconv3d.model.loading.text import blocks, numbers, plain_text, points, without_comments
from meshconv3d.model.loading.triangles import Pieces, Triangles, fan, indices

_KEYWORD = re.compile(rb"\s*((ST)?(C)?(N)?(4)?(n)?OFF\b)?[ \t]*(BINARY\b)?")
_NOT_BLANK = re.compile(rb"\S.*")
_FLOAT = np.dtype("<f8")


def read_off(data: bytes, limits: Limits) -> Triangles:
    """The triangles of an OFF file. Raises MalformedFile and LimitExceeded."""
    text = b"".join(map(without_comments, blocks(plain_text(data), limits)))
    keyword = _KEYWORD.match(text)
    assert keyword is not None  # every part of the pattern is optional
    _refuse_variants(keyword)
    body = text[keyword.end() :]
    counts, start = _counts(body)
    limits.check("vertices", counts[0])
    limits.check("faces", counts[1])
    body = body[start:]
    triangles = None
    first_line = _NOT_BLANK.search(body)
    if first_line and len(first_line[0].split()) > 2 and body.count(b"\n") >= sum(counts):
        triangles = _read_lines(body, *counts, limits)
    return triangles or _read_stream(body, *counts, _extra_numbers(keyword), limits)


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
    found = re.match(rb"\s*(\d{1,18})(\s+)(\d{1,18})(?:[ \t]*\n|\s+\d+)", body)
    if found and b"\n" in found[2]:
        found = re.match(rb"\s*(\d{1,18})(\s+)(\d{1,18})\s+\d+", body)
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


def _read_lines(
    body: bytes, vertex_count: int, face_count: int, limits: Limits
) -> Triangles | None:
    """One vertex or face a line; normals, colours and textures behind them are passed over.

    None where there are fewer lines than that.
    """
    pieces = Pieces(limits)
    missing_faces = face_count
    for block in blocks(body, limits):
        lines = [line for line in block.split(b"\n") if line.strip()]
        split = min(vertex_count - pieces.vertex_count, len(lines))
        vertices = points(lines[:split], "vertex line")
        rows = lines[split : split + missing_faces]
        missing_faces -= len(rows)
        pieces.add(vertices, _polygons(rows, limits))
    complete = pieces.vertex_count == vertex_count and not missing_faces
    return pieces.joined() if complete else None


def _polygons(rows: list[bytes], limits: Limits) -> NDArray[np.int64]:
    """The triangles of face lines, each of which begins with the count of its corners."""
    words = np.fromiter((len(row.split()) for row in rows), np.int64, len(rows))
    values = numbers(b"\n".join([*rows, b""]), limits)
    starts = np.cumsum(words) - words
    counts = indices(values[starts])
    if (counts < 0).any() or (counts >= words).any():
        raise MalformedFile("bad-face", "a face line has fewer vertices than it declares")
    place = np.arange(len(values)) - np.repeat(starts, words)
    corners = values[(place > 0) & (place <= np.repeat(counts, words))]
    return fan(corners, counts, limits)


def _read_stream(
    body: bytes, vertex_count: int, face_count: int, extra: int, limits: Limits
) -> Triangles:
    """Numbers without regard to lines; then a face cannot have a colour behind it."""
    data = numbers(body, limits).view(np.uint8).data
    fields = tuple(Field(str(place), _FLOAT) for place in range(3 + extra))
    vertex, end = read_element(data, 0, Element("vertex", vertex_count, fields), "012", limits)
    corner = Field("corners", _FLOAT, _FLOAT)
    element = Element("face", face_count, (corner,))
    face, end = read_element(data, end, element, ("corners",), limits)
    if end != len(data):
        raise MalformedFile(
            "bad-face",
            "numbers are left over after the last face; write one vertex or face a line",
        )
    vertices = np.stack([vertex[str(axis)].values for axis in range(3)], axis=1)
    corners = face["corners"]
    return vertices, fan(corners.values, corners.counts, limits)


def _extra_numbers(keyword: re.Match[bytes]) -> int:
    """Numbers behind the coordinates of a vertex: texture 2, colour 4, normal 3."""
    return 2 * bool(keyword[2]) + 4 * bool(keyword[3]) + 3 * bool(keyword[4])
