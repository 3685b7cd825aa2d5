"""Wavefront OBJ: the `v` and `f` lines; materials, groups, normals and textures are passed over."""

import re

import numpy as np
from numpy.typing import NDArray

from meshconv3d.model.errors import MalformedFile, UnusableMesh
from meshconv3d.model.jit import inlined, kernel
from meshconv3d.model.loading.limits import Limits
from meshconv3d.model.loading.text import (
    HASH,
    LINE_FEED,
    MINUS,
    NINE,
    PLUS,
    ZERO,
    convert,
    is_space,
    line_end,
    next_in_line,
    number,
    plain_text,
    quoted_line,
    word_end,
)
from meshconv3d.model.loading.triangles import Triangles, triangulate

_VERTEX, _FACE, _SLASH, _SPACE = b"vf/ "
_DIGITS = 18  # of a reference

# v and f lines that the next line continues; in other lines, a last backslash ends a path.
_CONTINUED = re.compile(rb"^[ \t]*[vf][ \t][^\n#]*\\\n(?:[^\n#]*\\\n)*", re.MULTILINE)

_OK, _BAD_VERTEX, _BAD_FACE = range(3)


def read_obj(data: bytes, limits: Limits) -> Triangles:
    """The triangles of an OBJ file. Raises MalformedFile, UnusableMesh and LimitExceeded."""
    text = plain_text(data)
    if b"\\" in text:
        text = _CONTINUED.sub(lambda lines: lines[0].replace(b"\\\n", b" "), text) + b"\n"
    scanned = np.frombuffer(text, np.uint8)
    # At least as many as there are; what of an array stays unused takes no memory.
    space = scanned <= _SPACE
    words = int(np.count_nonzero(space[1:] & ~space[:-1]))
    vertices = np.empty((words // 4 + 1, 3))
    corners, counts = np.empty(words, np.int64), np.empty(words, np.int64)
    ended, place, *found = _scan(scanned, vertices, corners, counts)
    if ended == _BAD_VERTEX:
        raise MalformedFile(
            "bad-vertex",
            "each v line must begin with three numbers x y z, "
            f"unlike the line {quoted_line(text, place)}",
        )
    if ended == _BAD_FACE:
        raise MalformedFile(
            "bad-face",
            "each f line must name its vertices by whole numbers, "
            f"unlike the line {quoted_line(text, place)}",
        )
    vertices, corners, counts = vertices[: found[0]], corners[: found[1]], counts[: found[2]]
    limits.check("vertices", len(vertices))
    limits.check("faces", len(counts))
    convert(text, vertices)
    _check_references(corners, len(vertices))
    return vertices, triangulate(vertices, corners, counts, limits)


def _check_references(corners: NDArray[np.int64], vertices: int) -> None:
    outside = int(np.count_nonzero((corners < 0) | (corners >= vertices)))
    if outside:
        raise UnusableMesh(
            "index-out-of-range",
            f"{outside} of {len(corners)} face corners name a vertex that does not exist: indices "
            f"begin at 1 and end at {vertices}, or count back from the line of the face (-1, -2, "
            "...); the file is damaged or was written wrongly",
        )


@kernel
def _scan(text, vertices, corners, counts):
    """Fill arrays that are long enough, up to the first line that is wrong.

    vertices: V x 3. corners: vertices of the faces, counted from 0; -1 for one that cannot exist.
    counts: the corners of each face. Returns how the scan ended, where, and how many vertices,
    corners and faces there are.
    """
    vertex = corner = face = place = 0
    while place < len(text):
        place = next_in_line(text, place)
        kind = text[place]
        if kind == _VERTEX and is_space(text[place + 1]):
            place += 1
            for axis in range(3):
                place = next_in_line(text, place)
                if _line_ends(text, place):
                    return _BAD_VERTEX, place, vertex, corner, face
                vertices[vertex, axis], place = number(text, place)
            vertex += 1
        elif kind == _FACE and is_space(text[place + 1]):
            first = corner
            place = next_in_line(text, place + 1)
            while not _line_ends(text, place):
                corners[corner], place = _reference(text, place, vertex)
                if corners[corner] < -1:
                    return _BAD_FACE, place, vertex, corner, face
                corner += 1
                place = next_in_line(text, word_end(text, place))
            counts[face] = corner - first
            face += 1
        place = line_end(text, place) + 1
    return _OK, place, vertex, corner, face


@inlined
def _line_ends(text, place):
    """Whether the next word of a line is none, or begins a comment."""
    return text[place] == LINE_FEED or text[place] == HASH


@kernel
def _reference(text, place, vertices):
    """The vertex that a word names, counted from 0, and the place where its number ends.

    vertices: how many there are before the face, from which negative numbers count back.

    The vertex is -1 for one that cannot exist, and -2 where the word is none of `7`, `7/1/2`, ...
    """
    negative = text[place] == MINUS
    if negative or text[place] == PLUS:
        place += 1
    index, first = 0, place
    while ZERO <= text[place] <= NINE and place - first <= _DIGITS:
        index = 10 * index + (text[place] - ZERO)
        place += 1
    if not 1 <= place - first <= _DIGITS or not (text[place] == _SLASH or is_space(text[place])):
        return -2, first
    return max(vertices - index if negative and index else index - 1, -1), place
