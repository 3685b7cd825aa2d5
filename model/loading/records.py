"""Elements from bytes: all records at once where they are alike, else by what their lists say."""

from collections.abc import Collection

import numpy as np

from meshconv3d.model.loading.elements import Buffer, Column, Element, Field, cut_off, whole
from meshconv3d.model.loading.limits import Limits
from meshconv3d.model.loading.ragged import read_ragged

_COUNTED = {"vertex": "vertices", "face": "faces"}


def read_element(
    data: Buffer, start: int, element: Element, wanted: Collection[str | None], limits: Limits
) -> tuple[dict[str, Column], int]:
    """The `wanted` columns of an element that begins at byte `start`, and the byte after it.

    Raises MalformedFile when the data ends before; LimitExceeded when it has too many vertices,
    faces, or lists that differ in length, which are read one by one.
    """
    least = element.length * sum(field.least for field in element.fields)
    if least > len(data) - start:
        raise cut_off(element)
    if element.name in _COUNTED:
        limits.check(_COUNTED[element.name], element.length)
    if least == 0:
        return {field.name: _nothing(field) for field in element.fields}, start
    return _read_uniform(data, start, element, wanted) or read_ragged(
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
            raise cut_off(element)
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


def _list_length(data: Buffer, position: int, count: np.dtype, element: Element) -> int:
    if position + count.itemsize > len(data):
        raise cut_off(element)
    return whole(np.frombuffer(data, dtype=count, count=1, offset=position)[0], element)


def _nothing(field: Field) -> Column:
    return Column(np.empty(0, dtype=field.item), np.empty(0, dtype=np.int64))
