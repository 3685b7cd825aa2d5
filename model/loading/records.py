"""Elements of records: a count of equal records whose fields are numbers or lists of numbers.

That is the data model of PLY. Text is read as such records too, each number a float64, so that
binary and ASCII files have one reader.
"""

import struct
from collections.abc import Callable, Collection
from dataclasses import dataclass

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
from numpy.typing import NDArray

from model.errors import MalformedFile
from model.loading.limits import Limits
from model.loading.text import quoted

Buffer = bytes | memoryview
_COUNTED = {"vertex": "vertices", "face": "faces"}
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


def read_element(
    data: Buffer, start: int, element: Element, wanted: Collection[str | None], limits: Limits
) -> tuple[dict[str, Column], int]:
    """The `wanted` columns of an element that begins at byte `start`, and the byte after it.

    Raises MalformedFile when the data ends before; LimitExceeded when it has too many vertices,
    faces, or lists that differ in length, which are read one by one.
    """
    least = element.length * sum(field.least for field in element.fields)
    if least > len(data) - start:
        raise _cut_off(element)
    if element.name in _COUNTED:
        limits.check(_COUNTED[element.name], element.length)
    if least == 0:
        return {field.name: _nothing(field) for field in element.fields}, start
    return _read_uniform(data, start, element, wanted) or _read_ragged(
        data, start, element, wanted, limits
    )


def _read_uniform(
    data: Buffer, start: int, element: Element, wanted: Collection[str | None]
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
        if field.name in wanted:
            counts = np.full(element.length, 1 if length is None else length)
            columns[field.name] = Column(table[f"item{index}"].reshape(-1), counts)
    return columns, end


def _read_ragged(
    data: Buffer, start: int, element: Element, wanted: Collection[str | None], limits: Limits
) -> tuple[dict[str, Column], int]:
    """How long each list is, record by record; from that where each field lies, all at once."""
    lists = [field for field in element.fields if field.count is not None]
    count = element.length * len(lists)
    found = f"the file has {count} lists in its {quoted(element.name)} records"
    limits.check("faces", count, found)
    lengths, end = _list_lengths(data, start, element)
    sizes = np.array([field.item.itemsize for field in lists])
    least = sum(field.least for field in element.fields)
    records = least + lengths @ sizes
    place = start + np.cumsum(records) - records  # of one field, in each record
    columns: dict[str, Column] = {}
    number = 0
    for field in element.fields:
        counts = np.ones(element.length, dtype=np.int64)
        place = place + (0 if field.count is None else field.count.itemsize)
        if field.count is not None:
            counts = lengths[:, number]
            number += 1
        if field.name in wanted:
            # A list that is wanted is a polygon.
            limits.check("faces", int(np.maximum(counts - 2, 0).sum()))
            columns[field.name] = Column(_gather(data, place, counts, field.item), counts)
        place = place + counts * field.item.itemsize
    return columns, end


def _list_lengths(data: Buffer, start: int, element: Element) -> tuple[NDArray[np.int64], int]:
    """The length of each list (records x lists), and the byte after the last record."""
    steps: list[tuple[int, Callable, int, int]] = []
    gap = 0  # bytes of the numbers since the last list
    for field in element.fields:
        if field.count is None:
            gap += field.item.itemsize
            continue
        steps.append((gap, _unpacker(field.count), field.count.itemsize, field.item.itemsize))
        gap = 0
    lengths: list[int] = []
    position = start
    for _ in range(element.length):
        for before, unpack, width, size in steps:
            position += before
            try:
                length = _whole(unpack(data, position)[0], element)
            except struct.error:
                raise _cut_off(element) from None
            lengths.append(length)
            position += width + length * size
        position += gap
    if position > len(data):
        raise _cut_off(element)
    return np.array(lengths, dtype=np.int64).reshape(element.length, len(steps)), position


def _gather(
    data: Buffer, where: NDArray[np.int64], counts: NDArray[np.int64], item: np.dtype
) -> NDArray:
    """The numbers that lie at `where`, counts[i] of them each, one after another."""
    before = np.cumsum(counts) - counts
    number = np.arange(counts.sum())
    places = np.repeat(where - before * item.itemsize, counts) + number * item.itemsize
    raw = np.frombuffer(data, dtype=np.uint8)
    if not len(places):
        return np.empty(0, dtype=item)
    return sliding_window_view(raw, item.itemsize)[places].view(item).reshape(-1)


def _list_length(data: Buffer, position: int, count: np.dtype, element: Element) -> int:
    if position + count.itemsize > len(data):
        raise _cut_off(element)
    return _whole(np.frombuffer(data, dtype=count, count=1, offset=position)[0], element)


def _whole(length: float, element: Element) -> int:
    """The length of a list. Raises MalformedFile when it is none."""
    if not (0 <= length < 2**63 and length == int(length)):
        raise MalformedFile(
            "bad-face",
            f"a list in the {quoted(element.name)} records declares {length} entries; "
            "the file is damaged",
        )
    return int(length)


def _unpacker(count: np.dtype) -> Callable[[Buffer, int], tuple]:
    order = ">" if count.str.startswith(">") else "<"
    return struct.Struct(order + _STRUCT_CODES[count.str[1:]]).unpack_from


def _nothing(field: Field) -> Column:
    return Column(np.empty(0, dtype=field.item), np.empty(0, dtype=np.int64))


def _cut_off(element: Element) -> MalformedFile:
    return MalformedFile(
        "truncated",
        f"the file declares {element.length} {quoted(element.name)} records, "
        "but ends before the last; it is cut off, export or upload it again",
    )
