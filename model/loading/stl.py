"""STL, binary and ASCII."""

import re

import numpy as np

from meshconv3d.model.errors import MalformedFile
from meshconv3d.model.loading.limits import Limits
from meshconv3d.model.loading.text import blocks, plain_text, points
from meshconv3d.model.loading.triangles import Pieces, Triangles, coordinates

_HEADER = 84  # bytes: 80 of any content, then the count of triangles
_RECORD = np.dtype([("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("attribute", "<u2")])

_VERTEX = re.compile(rb"^[ \t]*vertex[ \t]+(.*)$", re.MULTILINE | re.IGNORECASE)
_FACET = re.compile(rb"^[ \t]*facet\b", re.MULTILINE | re.IGNORECASE)
_END = re.compile(rb"^[ \t]*end[ \t]?solid\b", re.MULTILINE | re.IGNORECASE)
_NO_FACES = np.empty((0, 3), dtype=np.int64)


def is_exact_binary(data: bytes) -> bool:
    """Whether the count in the header fits the length to the byte, as only binary STL does."""
    return len(data) >= _HEADER and _declared_length(data) == len(data)


def read_stl(data: bytes, limits: Limits) -> Triangles:
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


def _read_binary(data: bytes, limits: Limits) -> Triangles:
    count = _declared_count(data)
    limits.check("faces", count)
    limits.check("vertices", 3 * count)
    records = np.frombuffer(data, dtype=_RECORD, count=count, offset=_HEADER)
    vertices = coordinates(records["corners"].reshape(-1, 3))
    return vertices, np.arange(3 * count).reshape(-1, 3)


def _read_ascii(text: bytes, limits: Limits) -> Triangles:
    pieces = Pieces(limits)
    facets, ended = 0, False
    for block in blocks(text, limits):
        facets += len(_FACET.findall(block))
        limits.check("faces", facets)
        pieces.add(points(_VERTEX.findall(block), "vertex line"), _NO_FACES)
        ended = ended or _END.search(block) is not None
    if not ended:
        raise MalformedFile(
            "truncated", "the text ends without 'endsolid'; it is cut off, export it again"
        )
    vertices, _ = pieces.joined()
    if len(vertices) != 3 * facets:
        raise MalformedFile(
            "bad-face",
            f"{facets} facets must have {3 * facets} vertices, but there are {len(vertices)}; "
            "the file is damaged or was written wrongly, export it again",
        )
    return vertices, np.arange(len(vertices)).reshape(-1, 3)


def _declared_count(data: bytes) -> int:
    return int.from_bytes(data[80:84], "little")


def _declared_length(data: bytes) -> int:
    return _HEADER + _RECORD.itemsize * _declared_count(data)


def _is_text(data: bytes) -> bool:
    start = data[:1024]
    return b"solid" in start.lower() and b"\0" not in start.rstrip(b"\0")
