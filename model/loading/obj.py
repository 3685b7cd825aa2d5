"""Wavefront OBJ: the `v` and `f` lines; materials, groups, normals and textures are passed over."""

import re

import numpy as np
from numpy.typing import NDArray

from meshconv3d.model.errors import MalformedFile
from meshconv3d.model.loading.limits import Limits
from meshconv3d.model.loading.text import blocks, plain_text, points, quoted, without_comments
from meshconv3d.model.loading.triangles import Pieces, Triangles, fan

_VERTEX = re.compile(rb"^[ \t]*v(?:[ \t](.*))?$", re.MULTILINE)
_FACE = re.compile(rb"^[ \t]*f(?:[ \t](.*))?$", re.MULTILINE)
_VERTEX_OR_FACE = re.compile(rb"^[ \t]*([vf])(?:[ \t]|$)", re.MULTILINE)
_WHOLE = re.compile(rb"[-+]?[0-9]{1,18}")


def read_obj(data: bytes, limits: Limits) -> Triangles:
    """The triangles of an OBJ file. Raises MalformedFile and LimitExceeded."""
    # The last line may say that it continues.
    text = plain_text(data).replace(b"\\\n", b" ") + b"\n"
    pieces = Pieces(limits)
    polygons = 0
    for block in blocks(text, limits):
        block = without_comments(block)
        lines = _FACE.findall(block)
        polygons += len(lines)
        limits.check("faces", polygons)
        vertices = points(_VERTEX.findall(block), "v line")
        pieces.add(vertices, _faces(lines, block, pieces.vertex_count, limits))
    return pieces.joined()


def _faces(
    lines: list[bytes], block: bytes, vertices_before: int, limits: Limits
) -> NDArray[np.int64]:
    """The triangles of the f lines of a block; references count from 0, -1 names nothing."""
    if b"/" in block and lines:
        lines = re.sub(rb"/\S*", b"", b"\n".join(lines)).split(b"\n")
    counts = np.fromiter((len(line.split()) for line in lines), np.int64, len(lines))
    corners = _references(lines)
    if corners.size and corners.min() < 0:
        corners = _absolute(corners, counts, block, vertices_before)
    # OBJ counts from 1: what was 0, which names nothing, becomes -1 and is refused by Mesh.
    return fan(corners - 1, counts, limits)


def _references(lines: list[bytes]) -> NDArray[np.int64]:
    """The vertex references of all face lines as they are written."""
    text = b" ".join(lines)
    words = text.split()
    try:
        corners = np.array(words, dtype=np.int64)
    except (ValueError, OverflowError):
        corners = None
    # Python reads 1_000 as a thousand.
    if corners is None or b"_" in text:
        bad = next(word for word in words if not _WHOLE.fullmatch(word))
        raise MalformedFile(
            "bad-face", f"each f line must name its vertices by whole numbers, not {quoted(bad)}"
        )
    return corners


def _absolute(
    corners: NDArray[np.int64],
    counts: NDArray[np.int64],
    block: bytes,
    vertices_before: int,
) -> NDArray[np.int64]:
    """References counted from 1: -1 is the last vertex written before the face, -2 the one before.

    One that reaches back past the first vertex becomes 0, which names nothing.
    """
    kinds = np.array(_VERTEX_OR_FACE.findall(block))
    seen = vertices_before + np.cumsum(kinds == b"v")[kinds == b"f"]
    backward = np.maximum(np.repeat(seen, counts) + 1 + corners, 0)
    return np.where(corners < 0, backward, corners)
