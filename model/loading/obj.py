"""Wavefront OBJ: the `v` and `f` lines; materials, groups, normals and textures are passed over."""

import re

import numpy as np
from numpy.typing import NDArray

from model.errors import MalformedFile
from model.loading.text import plain_text, points
from model.loading.triangles import Triangles, fan

_VERTEX = re.compile(rb"^[ \t]*v(?:[ \t](.*))?$", re.MULTILINE)
_FACE = re.compile(rb"^[ \t]*f(?:[ \t](.*))?$", re.MULTILINE)
_VERTEX_OR_FACE = re.compile(rb"^[ \t]*([vf])(?:[ \t]|$)", re.MULTILINE)


def read_obj(data: bytes) -> Triangles:
    """The triangles of an OBJ file. Raises MalformedFile."""
    text = plain_text(data).replace(b"\\\n", b" ")
    if b"#" in text:
        text = re.sub(rb"#[^\n]*", b"", text)
    vertices = points(_VERTEX.findall(text), "v line")
    lines = _FACE.findall(text)
    if b"/" in text:
        lines = re.sub(rb"/\S*", b"", b"\n".join(lines)).split(b"\n") if lines else []
    counts = np.fromiter((len(line.split()) for line in lines), np.int64, len(lines))
    corners = _references(lines)
    if corners.size and corners.min() < 0:
        corners = _absolute(corners, counts, text)
    # OBJ counts from 1: what was 0, which names nothing, becomes -1 and is refused by Mesh.
    return vertices, fan(corners - 1, counts)


def _references(lines: list[bytes]) -> NDArray[np.int64]:
    """The vertex references of all face lines as they are written."""
    try:
        return np.array(b" ".join(lines).split(), dtype=np.int64)
    except (ValueError, OverflowError) as error:
        raise MalformedFile(
            "bad-face", f"each f line must name its vertices by whole numbers: {error}"
        ) from error


def _absolute(
    corners: NDArray[np.int64], counts: NDArray[np.int64], text: bytes
) -> NDArray[np.int64]:
    """References counted from 1: -1 is the last vertex written before the face, -2 the one before.

    One that reaches back past the first vertex becomes 0, which names nothing.
    """
    kinds = np.array(_VERTEX_OR_FACE.findall(text))
    seen = np.cumsum(kinds == b"v")[kinds == b"f"]
    backward = np.maximum(np.repeat(seen, counts) + 1 + corners, 0)
    return np.where(corners < 0, backward, corners)
