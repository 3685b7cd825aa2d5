"""Elements whose lists differ in length: read in two steps, since one list hides the next."""

import struct
from collections.abc import Callable, Collection

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
from numpy.typing import NDArray

from meshconv3d.model.loading.elements import Buffer, Column, Element, cut_off, whole
from meshconv3d.model.loading.limits import Limits
from meshconv3d.model.loading.text import quoted

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


def read_ragged(
    data: Buffer, start: int, element: Element, wanted: Collection[str | None], limits: Limits
) -> tuple[dict[str, Column], int]:
    """The `wanted` columns of an element that begins at byte `start`, and the byte after it.

    How long each list is, record by record; from that where each field lies, all at once.

    Raises MalformedFile when the data ends before, LimitExceeded when there are too many lists.
    """
    lists = [field for field in element.fields if field.count is not None]
    count = element.length * len(lists)
    found = f"the file has {count} lists in its {quoted(element.name)} records"
    limits.check("faces", count, found)
    lengths, end = _list_lengths(data, start, element)
    sizes = np.array([field.item.itemsize for field in lists], dtype=np.int64)
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
                length = whole(unpack(data, position)[0], element)
            except struct.error:
                raise cut_off(element) from None
            lengths.append(length)
            position += width + length * size
        position += gap
    if position > len(data):
        raise cut_off(element)
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


def _unpacker(count: np.dtype) -> Callable[[Buffer, int], tuple]:
    order = ">" if count.str.startswith(">") else "<"
    return struct.Struct(order + _STRUCT_CODES[count.str[1:]]).unpack_from
