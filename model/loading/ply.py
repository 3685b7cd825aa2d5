"""Stanford PLY, ASCII and binary: vertices, and faces or triangle strips."""

import re
from codecs import BOM_UTF8

import numpy as np
from numpy.typing import NDArray

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
from meshconv3d.model.loading.text import plain_text, quoted
from meshconv3d.model.loading.triangles import NotedTriangles, triangulate

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
_WHOLE = {name for name, kind in _TYPES.items() if kind[0] != "f"}
_ORDERS = {"ascii": None, "binary_little_endian": "<", "binary_big_endian": ">"}
_COUNT = re.compile("[0-9]{1,18}")
_LONGEST_HEADER = 2**18  # bytes
_FACES = ("face", "tristrips")
_CORNER_NAMES = ("vertex_indices", "vertex_index")


def read_ply(data: bytes, limits: Limits) -> NotedTriangles:
    """The triangles of a PLY file. Raises MalformedFile and LimitExceeded."""
    data = data.removeprefix(BOM_UTF8)
    lines, place = _split_header(data)
    order = _byte_order(lines)
    elements = _elements(lines, order or "<")
    wanted = _wanted(elements)
    if order:
        tables, place = read_binary(data, place, elements, wanted, limits)
    else:
        data = plain_text(data[place:])
        tables, place = read_text(data, 0, elements, wanted, limits)
    vertices = tables["vertex"].numbers
    faces = [np.empty((0, 3), dtype=np.int64)]
    if "face" in wanted:
        _, corners, counts = tables["face"]
        faces.append(triangulate(vertices, corners, counts, limits))
    if "tristrips" in wanted:
        faces.append(_strips(tables["tristrips"], limits))
    return vertices, np.concatenate(faces), note_of_more(data, place)


def _strips(table: Table, limits: Limits) -> NDArray[np.int64]:
    """The triangles of strips, in which every second is wound the other way, and -1 begins anew."""
    limits.check("faces", len(table.items))
    strips = np.insert(table.items, np.cumsum(table.counts), -1)
    step = np.arange(len(strips))
    began = np.maximum.accumulate(np.where(strips < 0, step + 1, 0))
    first = step[:-2]
    odd = (first - began[:-2]) % 2
    faces = strips[np.stack([first + odd, first + 1 - odd, first + 2], axis=1)]
    return faces[(faces >= 0).all(axis=1)]


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
    header = re.split("[\r\n]", head[: end.start()].decode("latin-1"))
    return [words for line in header if (words := line.split())], body


def _byte_order(lines: list[list[str]]) -> str | None:
    """ "<" or ">" for a binary body, None for ASCII."""
    for words in lines:
        if words[0] == "format" and len(words) > 1 and words[1] in _ORDERS:
            return _ORDERS[words[1]]
    raise MalformedFile("bad-header", f"the header names no format (one of {', '.join(_ORDERS)})")


def _elements(lines: list[list[str]], order: str) -> list[Element]:
    """The elements that the header declares, in the order of the body."""
    found: list[tuple[str, int, list[Field]]] = []
    for words in lines:
        match words:
            case ["element", name, length] if _COUNT.fullmatch(length):
                found.append((name, int(length), []))
            case ["property", "list", count, item, name] if (
                found and count in _WHOLE and item in _TYPES
            ):
                field = Field(name, np.dtype(order + _TYPES[item]), np.dtype(order + _TYPES[count]))
                found[-1][2].append(field)
            case ["property", item, name] if found and item in _TYPES:
                found[-1][2].append(Field(name, np.dtype(order + _TYPES[item])))
            case ["element" | "property", *_]:
                raise MalformedFile(
                    "bad-header", f"the header line {quoted(' '.join(words))} makes no sense"
                )
    return [Element(name, length, tuple(fields)) for name, length, fields in found]


def _wanted(elements: list[Element]) -> dict[str, list[str]]:
    """The fields to read, by element. Raises MalformedFile where the header makes no sense."""
    names = [element.name for element in elements]
    if names.count("vertex") != 1 or any(names.count(name) > 1 for name in _FACES):
        raise MalformedFile("bad-header", "the header must declare vertices once, and faces once")
    vertex = elements[names.index("vertex")]
    numbers = [field.name for field in vertex.fields if field.count is None]
    missing = [axis for axis in "xyz" if numbers.count(axis) != 1]
    if missing:
        raise MalformedFile(
            "bad-header", f"the vertex element has no one property {', '.join(missing)}"
        )
    faces = {element.name: [_corners(element)] for element in elements if element.name in _FACES}
    return {"vertex": list("xyz"), **faces}


def _corners(face: Element) -> str:
    """The lists of vertex indices, by either of their names or as the only list there is."""
    lists = [
        field.name for field in face.fields if field.count is not None and field.item.kind != "f"
    ]
    known = [name for name in lists if name in _CORNER_NAMES] or lists
    if len(known) == 1:
        return known[0]
    raise MalformedFile(
        "bad-header",
        f"the {face.name} element has no one list property {' or '.join(_CORNER_NAMES)} of "
        "whole numbers",
    )
