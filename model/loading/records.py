"""Elements of records: a count of equal records whose fields are numbers or lists of numbers.

That is the data model of PLY. Text is read as such records too, each number a float64, so that
binary and ASCII files have one reader.
"""

import struct
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
from numpy.typing import NDArray

from model.errors import MalformedFile

_STRUCT_CODES = {
    "i1": "b",
    "u1": "B",
    "i2": "h",
    "u2": "H",
    "i4": "i",
    "u4": "I",
    "i8": "q",
    "u8": "Q",
    "f4": "f",
    "f8": "d",
}


@dataclass(frozen=True)
class Field:
    """One field of a record: a number, or with `count` a list that is preceded by its length.

    item, count: dtypes of the numbers and of the length.
    """

    name: str
    item: np.dtype
    count: np.dtype | None = None

    @property
    def least(self) -> int:
        """The fewest bytes it takes."""
        return self.item.itemsize if self.count is None else self.count.itemsize


@dataclass(frozen=True)
class Element:
    """`length` records of the same fields."""

    name: str
    length: int
    fields: tuple[Field, ...]


@dataclass(frozen=True)
class Column:
    """One field of all records: the numbers one after another, and how many each record has."""

    values: NDArray
    counts: NDArray[np.int64]


def read_element(data: bytes, start: int, element: Element) -> tuple[dict[str, Column], int]:
    """The columns of an element whose records begin at byte `start`, and the byte after them.

    Raises MalformedFile when the data ends before.
    """
    least = element.length * sum(field.least for field in element.fields)
    if least > len(data) - start:
        raise _cut_off(element)
    if element.length == 0 or least == 0:
        return {field.name: _nothing(field) for field in element.fields}, start
    return _read_uniform(data, start, element) or _read_ragged(data, start, element)


def _read_uniform(
    data: bytes, start: int, element: Element
) -> tuple[dict[str, Column], int] | None:
    """All records at once, where every list is as long as in the first record; else None."""
    layout: list[tuple] = []
    lengths: list[int | None] = []
    position = start
    for index, field in enumerate(element.fields):
        length = None
        if field.count is not None:
            length = _list_length(data, position, field.count, element)
            layout.append((f"count{index}", field.count))
            position += field.count.itemsize
        layout.append((f"item{index}", field.item, (1 if length is None else length,)))
        position += field.item.itemsize * (1 if length is None else length)
        if position > len(data):
            raise _cut_off(element)
        lengths.append(length)
    record = np.dtype(layout)
    end = start + element.length * record.itemsize
    if end > len(data):
        return None
    table = np.frombuffer(data, dtype=record, count=element.length, offset=start)
    columns: dict[str, Column] = {}
    for index, (field, length) in enumerate(zip(element.fields, lengths, strict=True)):
        if length is not None and (table[f"count{index}"] != length).any():
            return None
        counts = np.full(element.length, 1 if length is None else length)
        columns[field.name] = Column(table[f"item{index}"].reshape(-1), counts)
    return columns, end


def _read_ragged(data: bytes, start: int, element: Element) -> tuple[dict[str, Column], int]:
    """Record by record: where each field lies and how long it is; then field by field."""
    where = np.empty((element.length, len(element.fields)), dtype=np.int64)
    counts = np.ones((element.length, len(element.fields)), dtype=np.int64)
    steps = [
        (index, field.item.itemsize, _unpacker(field.count), field.least)
        for index, field in enumerate(element.fields)
    ]
    position = start
    for record in range(element.length):
        for index, size, unpack, least in steps:
            if unpack is None:
                where[record, index] = position
                position += size
                continue
            try:
                length = _whole(unpack(data, position)[0], element)
            except struct.error:
                raise _cut_off(element) from None
            position += least
            where[record, index] = position
            counts[record, index] = length
            position += length * size
    if position > len(data):
        raise _cut_off(element)
    return {
        field.name: Column(_gather(data, where[:, i], counts[:, i], field.item), counts[:, i])
        for i, field in enumerate(element.fields)
    }, position


def _gather(
    data: bytes, where: NDArray[np.int64], counts: NDArray[np.int64], item: np.dtype
) -> NDArray:
    """The numbers that lie at `where`, counts[i] of them each, one after another."""
    raw = np.frombuffer(data, dtype=np.uint8)
    values = np.empty(int(counts.sum()), dtype=item)
    offsets = np.cumsum(counts) - counts
    for length in np.unique(counts[counts > 0]):
        chosen = np.flatnonzero(counts == length)
        lists = sliding_window_view(raw, length * item.itemsize)[where[chosen]].view(item)
        values[offsets[chosen, None] + np.arange(length)] = lists
    return values


def _list_length(data: bytes, position: int, count: np.dtype, element: Element) -> int:
    if position + count.itemsize > len(data):
        raise _cut_off(element)
    return _whole(np.frombuffer(data, dtype=count, count=1, offset=position)[0], element)


def _whole(length: float, element: Element) -> int:
    """The length of a list. Raises MalformedFile when it is none."""
    if not (0 <= length < 2**63 and length == int(length)):
        raise MalformedFile(
            "bad-face",
            f"a list in the {element.name} records declares {length} entries; the file is damaged",
        )
    return int(length)


def _unpacker(count: np.dtype | None) -> Callable[[bytes, int], tuple] | None:
    if count is None:
        return None
    order = ">" if count.str.startswith(">") else "<"
    return struct.Struct(order + _STRUCT_CODES[count.str[1:]]).unpack_from


def _nothing(field: Field) -> Column:
    return Column(np.empty(0, dtype=field.item), np.empty(0, dtype=np.int64))


def _cut_off(element: Element) -> MalformedFile:
    return MalformedFile(
        "truncated",
        f"the file declares {element.length} {element.name} records, but ends before the last; "
        "it is cut off, export or upload it again",
    )
