"""Stanford PLY, ASCII and binary: the elements `vertex` and `face`; all others are passed over."""

import re
from codecs import BOM_UTF8

import numpy as np

from model.errors import MalformedFile
from model.loading.records import Column, Element, Field, read_element
from model.loading.text import numbers, plain_text
from model.loading.triangles import Triangles, fan, indices

_TYPES = {
    "char": "i1",
    "int8": "i1",
    "uchar": "u1",
    "uint8": "u1",
    "short": "i2",
    "int16": "i2",
    "ushort": "u2",
    "uint16": "u2",
    "int": "i4",
    "int32": "i4",
    "uint": "u4",
    "uint32": "u4",
    "int64": "i8",
    "uint64": "u8",
    "float": "f4",
    "float32": "f4",
    "double": "f8",
    "float64": "f8",
}
# Every number of an ASCII body is read as this, whatever type the header declares.
_TEXT = np.dtype("<f8")
_ORDERS = {"ascii": None, "binary_little_endian": "<", "binary_big_endian": ">"}
_CORNER_NAMES = ("vertex_indices", "vertex_index")


def read_ply(data: bytes) -> Triangles:
    """The triangles of a PLY file. Raises MalformedFile."""
    data = data.removeprefix(BOM_UTF8)
    lines, body = _split_header(data)
    order = _byte_order(lines)
    elements = _elements(lines, order)
    records = data[body:] if order else numbers(plain_text(data[body:])).tobytes()
    columns: dict[str, dict[str, Column]] = {}
    position = 0
    for element in elements:
        if {"vertex", "face"} <= columns.keys():
            break
        columns[element.name], position = read_element(records, position, element)
    if "tristrips" in columns and "face" not in columns:
        raise MalformedFile(
            "unsupported-feature",
            "the faces are stored as triangle strips, which are not read; export with a face list",
        )
    vertex, face = columns.get("vertex", {}), columns.get("face", {})
    missing = [axis for axis in "xyz" if axis not in vertex]
    if missing:
        raise MalformedFile(
            "bad-header", f"the vertex element has no property {', '.join(missing)}"
        )
    vertices = np.stack([vertex[axis].values for axis in "xyz"], axis=1).astype(np.float64)
    if not face:
        return vertices, np.empty((0, 3), dtype=np.int64)
    corners = _corners(face, elements)
    return vertices, fan(indices(corners.values), corners.counts)


def _split_header(data: bytes) -> tuple[list[list[str]], int]:
    """The words of each header line, and the byte at which the body begins."""
    first = re.match(rb"ply[ \t]*(\r\n|\n|\r)", data)
    end = re.search(rb"[\r\n]end_header[ \t]*(\r\n|\n|\r|\Z)", data)
    if first is None or end is None:
        raise MalformedFile(
            "bad-header",
            "a PLY file begins with a header from 'ply' to 'end_header'; it is cut off",
        )
    body = end.end()
    if first[1] == b"\r" and end[1] == b"\r\n":
        body -= 1  # lines end in CR here: the LF is the first byte of the data
    header = data[: end.start()].decode("latin-1")
    return [words for line in header.splitlines() if (words := line.split())], body


def _byte_order(lines: list[list[str]]) -> str | None:
    """ "<" or ">" for a binary body, None for ASCII."""
    for words in lines:
        if words[0] == "format" and len(words) > 1 and words[1] in _ORDERS:
            return _ORDERS[words[1]]
    raise MalformedFile("bad-header", f"the header names no format (one of {', '.join(_ORDERS)})")


def _elements(lines: list[list[str]], order: str | None) -> list[Element]:
    """The elements that the header declares, in the order of the body."""
    found: list[tuple[str, int, list[Field]]] = []
    for words in lines:
        try:
            match words:
                case ["element", name, length]:
                    found.append((name, _length(length), []))
                case ["property", "list", count, item, name]:
                    found[-1][2].append(Field(name, _dtype(item, order), _dtype(count, order)))
                case ["property", item, name]:
                    found[-1][2].append(Field(name, _dtype(item, order)))
                case ["element" | "property", *_]:
                    raise ValueError("wrong count of words")
        except (ValueError, KeyError, IndexError) as error:
            raise MalformedFile(
                "bad-header", f"the header line {' '.join(words)!r} is not understood: {error}"
            ) from error
    return [Element(name, length, tuple(fields)) for name, length, fields in found]


def _length(word: str) -> int:
    length = int(word)
    if length < 0:
        raise ValueError("a count cannot be negative")
    return length


def _dtype(name: str, order: str | None) -> np.dtype:
    dtype = np.dtype((order or "<") + _TYPES[name])
    return dtype if order else _TEXT


def _corners(face: dict[str, Column], elements: list[Element]) -> Column:
    """The lists of vertex indices, by either of their names or as the only list there is."""
    for name in _CORNER_NAMES:
        if name in face:
            return face[name]
    fields = next(element.fields for element in elements if element.name == "face")
    lists = [field.name for field in fields if field.count is not None]
    if len(lists) == 1:
        return face[lists[0]]
    raise MalformedFile(
        "bad-header", f"the face element has no list property {' or '.join(_CORNER_NAMES)}"
    )
