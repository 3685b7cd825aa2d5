"""Stanford PLY, ASCII and binary: the elements `vertex` and `face`; all others are passed over."""

import re
from codecs import BOM_UTF8

import numpy as np

from meshconv3d.model.errors import MalformedFile
from meshconv3d.model.loading.elements import Buffer, Column, Element, Field
from meshconv3d.model.loading.limits import Limits
from meshconv3d.model.loading.records import read_element
from meshconv3d.model.loading.text import numbers, plain_text, quoted
from meshconv3d.model.loading.triangles import Triangles, coordinates, fan

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
_COUNT = re.compile("[0-9]{1,18}")
_LONGEST_HEADER = 2**18  # bytes
_CORNER_NAMES = ("vertex_indices", "vertex_index")


def read_ply(data: bytes, limits: Limits) -> Triangles:
    """The triangles of a PLY file. Raises MalformedFile and LimitExceeded."""
    data = data.removeprefix(BOM_UTF8)
    lines, body = _split_header(data)
    order = _byte_order(lines)
    elements = _elements(lines, order)
    corner_name = _check_elements(elements)
    wanted = {*"xyz", corner_name}
    records: Buffer = data[body:]
    if not order:
        records = numbers(plain_text(data[body:]), limits).view(np.uint8).data
    columns: dict[str, dict[str, Column]] = {}
    position = 0
    for element in elements:
        if {"vertex", "face"} <= columns.keys():
            break
        columns[element.name], position = read_element(records, position, element, wanted, limits)
    vertex = columns["vertex"]
    vertices = np.stack([coordinates(vertex[axis].values) for axis in "xyz"], axis=1)
    if corner_name is None:
        return vertices, np.empty((0, 3), dtype=np.int64)
    corners = columns["face"][corner_name]
    return vertices, fan(corners.values, corners.counts, limits)


def _split_header(data: bytes) -> tuple[list[list[str]], int]:
    """The words of each header line, and the byte at which the body begins."""
    head = data[:_LONGEST_HEADER]
    first = re.match(rb"ply[ \t]*(\r\n|\n|\r)", head)
    end = re.search(rb"[\r\n]end_header[ \t]*(\r\n|\n|\r|\Z)", head)
    if first is None or end is None:
        raise MalformedFile(
            "bad-header",
            "a PLY file begins with a header from 'ply' to 'end_header', of "
            f"{_LONGEST_HEADER} bytes at most; it is cut off or damaged",
        )
    body = end.end()
    if first[1] == b"\r" and end[1] == b"\r\n":
        body -= 1  # lines end in CR here: the LF is the first byte of the data
    header = head[: end.start()].decode("latin-1")
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
        match words:
            case ["element", name, length] if _COUNT.fullmatch(length):
                found.append((name, int(length), []))
            case ["property", "list", count, item, name] if (
                found and {count, item} <= _TYPES.keys()
            ):
                found[-1][2].append(Field(name, _dtype(item, order), _dtype(count, order)))
            case ["property", item, name] if found and item in _TYPES:
                found[-1][2].append(Field(name, _dtype(item, order)))
            case ["element" | "property", *_]:
                raise MalformedFile(
                    "bad-header", f"the header line {quoted(' '.join(words))} makes no sense"
                )
    return [Element(name, length, tuple(fields)) for name, length, fields in found]


def _dtype(name: str, order: str | None) -> np.dtype:
    return np.dtype(order + _TYPES[name]) if order else _TEXT


def _check_elements(elements: list[Element]) -> str | None:
    """The name of the lists of vertex indices, None without faces; once the header makes sense."""
    names = [element.name for element in elements]
    if "tristrips" in names and "face" not in names:
        raise MalformedFile(
            "unsupported-feature",
            "the faces are stored as triangle strips, which are not read; export with a face list",
        )
    if names.count("vertex") != 1 or names.count("face") > 1:
        raise MalformedFile("bad-header", "the header must declare vertices once, and faces once")
    vertex = elements[names.index("vertex")]
    numbers = [field.name for field in vertex.fields if field.count is None]
    missing = [axis for axis in "xyz" if numbers.count(axis) != 1]
    if missing:
        raise MalformedFile(
            "bad-header", f"the vertex element has no one property {', '.join(missing)}"
        )
    if "face" not in names:
        return None
    return _corner_name(elements[names.index("face")])


def _corner_name(face: Element) -> str:
    """The lists of vertex indices, by either of their names or as the only list there is."""
    lists = [field.name for field in face.fields if field.count is not None]
    known = [name for name in lists if name in _CORNER_NAMES] or lists
    if len(known) == 1:
        return known[0]
    raise MalformedFile(
        "bad-header", f"the face element has no one list property {' or '.join(_CORNER_NAMES)}"
    )
