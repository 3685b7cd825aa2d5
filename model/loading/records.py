"""Elements of records, as in PLY and OFF: from bytes or from text to columns of numbers.

An element is a count of records of the same fields, each a number or a list of numbers that is
preceded by its length.
"""

from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass
from functools import partial

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
from numpy.typing import NDArray

from meshconv3d.model.errors import MalformedFile
from meshconv3d.model.jit import kernel
from meshconv3d.model.loading.limits import Limits
from meshconv3d.model.loading.text import (
    HASH,
    LINE_FEED,
    convert,
    line_end,
    next_in_line,
    next_word,
    number,
    parsed,
    quoted,
    quoted_line,
    word_end,
)

_COUNTED = {"vertex": "vertices", "face": "faces"}
_WHOLE = 2**53  # floats below are exact where they are whole

# What a field is for a scan of text: these, or the column of a number that is kept.
_SKIP, _SKIP_LIST, _KEEP_LIST = -1, -2, -3
_OK, _CUT_OFF, _SHORT, _BAD_LENGTH, _BAD_INDEX = range(5)


@dataclass(frozen=True)
class Field:
    """One field of a record: a number, or with `count` a list that is preceded by its length.

    item, count: dtypes of the numbers and of the length, an integer; of no meaning in text.
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


Columns = dict[str, dict[str, Column]]  # by the names of elements and fields
Wanted = Mapping[str, Collection[str]]  # names of fields by that of the element


def read_text(
    text: bytes,
    place: int,
    elements: Sequence[Element],
    wanted: Wanted,
    limits: Limits,
    *,
    comments: bool = False,
) -> tuple[Columns, int]:
    """The columns that are wanted of elements of numbers as text, and the place after them.

    text: ends in a line feed; the elements begin at `place`.
    wanted: for an element's name, names of its fields: numbers, and one list of whole numbers at
        most. All other words may be anything.
    comments: whether # begins one.

    Each record has a line, in which further words are passed over; or else all words count, and
    lines do not. The place is the end of the text where elements that are not wanted follow.
    Raises MalformedFile; LimitExceeded when there are too many vertices, faces or triangles.
    """
    fault = None
    start = next_word(np.frombuffer(text, np.uint8), place, comments)
    line = text[start : text.find(b"\n", start)].split(maxsplit=3)
    fields = next((len(element.fields) for element in elements if element.length), 0)
    if len(line) >= min(fields, 3):
        try:
            read = partial(_read_words, text, comments, limits, True)
            return _read_in_turn(read, place, elements, wanted, len(text))
        except MalformedFile as error:
            fault = error
    try:
        read = partial(_read_words, text, comments, limits, False)
        columns, place = _read_in_turn(read, place, elements, wanted, len(text))
    except MalformedFile as error:
        raise (fault or error) from None
    if next_word(np.frombuffer(text, np.uint8), place, comments) < len(text):
        raise fault or MalformedFile(
            "bad-face",
            "numbers are left over after the last face; write one vertex or face a line",
        )
    return columns, place


def read_binary(
    data: bytes, place: int, elements: Sequence[Element], wanted: Wanted, limits: Limits
) -> tuple[Columns, int]:
    """The columns that are wanted of elements of bytes; see `read_text`.

    Raises MalformedFile; LimitExceeded when there are too many vertices, faces, triangles, or lists
    that differ in length.
    """
    read = partial(_read_bytes, data, limits)
    return _read_in_turn(read, place, elements, wanted, len(data))


def note_of_more(data: bytes, place: int) -> str:
    """A note where more than padding follows the last record; else nothing."""
    more = data[place:].strip(b"\0\x1a \t\r\n")
    if not more:
        return ""
    return (
        f"The file goes on for {len(more)} bytes after the records that its header declares: "
        "they were not read."
    )


def _read_in_turn(
    read: Callable[[int, Element, Collection[str]], tuple[dict[str, Column], int]],
    place: int,
    elements: Sequence[Element],
    wanted: Wanted,
    end: int,
) -> tuple[Columns, int]:
    columns: Columns = {}
    for element in elements:
        if wanted.keys() <= columns.keys():
            return columns, end
        columns[element.name], place = read(place, element, wanted.get(element.name, ()))
    return columns, place


def _read_words(
    text: bytes,
    comments: bool,
    limits: Limits,
    lines: bool,
    place: int,
    element: Element,
    wanted: Collection[str],
) -> tuple[dict[str, Column], int]:
    """One element, and the place after it; `lines`: whether each record has a line of its own."""
    # A digit and white space for each field.
    _check_length(element, limits, 2 * len(element.fields), len(text) - place + 1)
    fields = list(element.fields)
    while lines and fields and fields[-1].name not in wanted:
        fields.pop()
    kinds = np.empty(len(fields), dtype=np.int64)
    names: list[str] = []
    for index, field in enumerate(fields):
        kept = field.name in wanted
        if field.count is not None:
            kinds[index] = _KEEP_LIST if kept else _SKIP_LIST
        else:
            kinds[index] = len(names) if kept else _SKIP
            names += [field.name] * kept
    records = element.length if element.fields else 0
    keeps_list = (kinds == _KEEP_LIST).any()
    values, counts = np.empty((records, len(names))), np.empty(records * keeps_list, np.int64)
    items = np.empty((len(text) - place) // 2 * keeps_list, np.int64)  # as many as there can be
    ended, place, item = _scan(
        np.frombuffer(text, np.uint8), place, kinds, lines, comments, records, values, counts, items
    )
    if ended != _OK:
        raise _word_error(ended, text, place, element)
    convert(text, values)
    ones = np.ones(len(values), dtype=np.int64)
    columns = {name: Column(values[:, index], ones) for index, name in enumerate(names)}
    for field, kind in zip(fields, kinds, strict=True):
        if kind == _KEEP_LIST:
            columns[field.name] = Column(items[:item], counts)
    return columns, place


def _read_bytes(
    data: bytes, limits: Limits, place: int, element: Element, wanted: Collection[str]
) -> tuple[dict[str, Column], int]:
    """One element, and the byte after it."""
    least = sum(field.least for field in element.fields)
    _check_length(element, limits, least, len(data) - place)
    if element.length * least == 0:
        nothing = np.empty(0, dtype=np.int64)
        return {field.name: Column(nothing, nothing) for field in element.fields}, place
    return _read_uniform(data, place, element, wanted) or _read_ragged(
        data, place, element, wanted, limits
    )


def _check_length(element: Element, limits: Limits, least: int, there: int) -> None:
    """Raises MalformedFile where records of `least` bytes cannot be there."""
    if least * element.length > there:
        raise _cut_off(element)
    if element.name in _COUNTED:
        limits.check(_COUNTED[element.name], element.length)


def _word_error(ended: int, text: bytes, place: int, element: Element) -> MalformedFile:
    """The error for the end that a scan of text came to."""
    if ended == _CUT_OFF:
        return _cut_off(element)
    if ended == _SHORT:
        return MalformedFile(
            f"bad-{element.name}" if element.name in _COUNTED else "bad-record",
            f"the line {quoted_line(text, place)} has fewer numbers than each record of "
            f"{quoted(element.name)} has",
        )
    found = parsed(text, place)
    if ended == _BAD_LENGTH:
        return _bad_length(found, element)
    return MalformedFile(
        "bad-index",
        f"a face names its vertices by whole numbers, unlike the line {quoted_line(text, place)}",
    )


def _bad_length(length: float, element: Element) -> MalformedFile:
    return MalformedFile(
        "bad-face",
        f"a list in the {quoted(element.name)} records declares {length} entries; "
        "the file is damaged",
    )


def _cut_off(element: Element) -> MalformedFile:
    return MalformedFile(
        "truncated",
        f"the file declares {element.length} {quoted(element.name)} records, "
        "but ends before the last; it is cut off, export or upload it again",
    )


@kernel
def _scan(text, place, kinds, lines, comments, records, values, counts, items):
    """Fill in the records of `read_text`, up to the first that is wrong.

    kinds: of each field, the column of a number, or _SKIP, _SKIP_LIST, _KEEP_LIST.
    values: records x columns. counts, items: lengths and items of the list that is kept.

    Returns how the scan ended, where, and the number of items.
    """
    item = 0
    for record in range(records):
        place = next_word(text, place, comments)
        for kind in kinds:
            words, length = 1, kind <= _SKIP_LIST  # left of the field; whether a length comes first
            while words:
                if lines and place < len(text):
                    place = next_in_line(text, place)
                    if text[place] == LINE_FEED or (comments and text[place] == HASH):
                        return _SHORT if place + 1 < len(text) else _CUT_OFF, place, item
                else:
                    place = next_word(text, place, comments)
                    if place == len(text):
                        return _CUT_OFF, place, item
                if kind == _SKIP or (kind == _SKIP_LIST and not length):
                    place = word_end(text, place)
                    words -= 1
                    continue
                value, end = number(text, place)
                if kind >= 0:
                    values[record, kind] = value
                    words -= 1
                elif not abs(value) < _WHOLE or value != np.trunc(value) or (length and value < 0):
                    return _BAD_LENGTH if length else _BAD_INDEX, place, item
                elif length:
                    words, length = np.int64(value), False
                    if kind == _KEEP_LIST:
                        counts[record] = words
                else:
                    items[item] = np.int64(value)
                    item += 1
                    words -= 1
                place = end
        if lines and place < len(text):
            place = line_end(text, place)
    return _OK, place, item


def _read_uniform(
    data: bytes, start: int, element: Element, wanted: Collection[str]
) -> tuple[dict[str, Column], int] | None:
    """All records at once, where every list is as long as in the first record; else None."""
    layout: list[tuple] = []
    lengths: list[int] = []
    position = start
    for index, field in enumerate(element.fields):
        length = 1
        if field.count is not None:
            if position + field.count.itemsize > len(data):
                raise _cut_off(element)
            length = int(np.frombuffer(data, dtype=field.count, count=1, offset=position)[0])
            if length < 0:
                raise _bad_length(length, element)
            layout.append((f"count{index}", field.count))
            position += field.count.itemsize
        position += field.item.itemsize * length
        if position > len(data):
            raise _cut_off(element)
        layout.append((f"item{index}", field.item, (length,)))
        lengths.append(length)
    record = np.dtype(layout)
    end = start + element.length * record.itemsize
    if end > len(data):
        return None
    table = np.frombuffer(data, dtype=record, count=element.length, offset=start)
    columns: dict[str, Column] = {}
    for index, (field, length) in enumerate(zip(element.fields, lengths, strict=True)):
        if field.count is not None and (table[f"count{index}"] != length).any():
            return None
        if field.name in wanted:
            counts = np.full(element.length, length)
            columns[field.name] = Column(table[f"item{index}"].reshape(-1), counts)
    return columns, end


def _read_ragged(
    data: bytes, start: int, element: Element, wanted: Collection[str], limits: Limits
) -> tuple[dict[str, Column], int]:
    """Records whose lists differ in length: how long each is, and from that where fields lie."""
    lists = [field for field in element.fields if field.count is not None]
    found = (
        f"the file has {element.length * len(lists)} lists in its {quoted(element.name)} records"
    )
    limits.check("faces", element.length * len(lists), found)
    steps = np.zeros((len(lists), 4), dtype=np.int64)
    gap, number = 0, 0  # bytes of the numbers since the last list
    for field in element.fields:
        if field.count is None:
            gap += field.item.itemsize
            continue
        signed = np.issubdtype(field.count, np.signedinteger)
        steps[number] = gap, field.count.itemsize, signed, field.item.itemsize
        gap, number = 0, number + 1
    big = any(field.count.str.startswith(">") for field in lists if field.count)
    raw = np.frombuffer(data, dtype=np.uint8)
    lengths, end, ended = _list_lengths(raw, start, element.length, steps, gap, big)
    if ended == _CUT_OFF:
        raise _cut_off(element)
    if ended == _BAD_LENGTH:
        raise _bad_length(-1, element)
    least = sum(field.least for field in element.fields)
    records = least + lengths @ steps[:, 3]
    place = start + np.cumsum(records) - records  # of one field, in each record
    columns: dict[str, Column] = {}
    number = 0
    for field in element.fields:
        counts = np.ones(element.length, dtype=np.int64)
        if field.count is not None:
            counts = lengths[:, number]
            number += 1
            place = place + field.count.itemsize
        if field.name in wanted:
            # A list that is wanted is a polygon.
            limits.check("faces", int(np.maximum(counts - 2, 0).sum()))
            columns[field.name] = Column(_gather(raw, place, counts, field.item), counts)
        place = place + counts * field.item.itemsize
    return columns, end


@kernel
def _list_lengths(data, place, length, steps, gap, big):
    """The length of each list (records x lists), the byte after the last record, and the fault.

    steps: of each list, bytes before it, of its length, whether that has a sign, bytes of an item.
    gap: bytes after the last list. big: whether lengths are big-endian.
    """
    lengths = np.zeros((length, len(steps)), np.int64)
    for record in range(length):
        for column in range(len(steps)):
            before, width, signed, size = steps[column]
            place += before
            if place + width > len(data):
                return lengths, place, _CUT_OFF
            entries = np.uint64(0)
            for byte in range(width):
                digit = data[place + (byte if big else width - 1 - byte)]
                entries = (entries << np.uint64(8)) | np.uint64(digit)
            if signed and entries >> np.uint64(8 * width - 1):
                return lengths, place, _BAD_LENGTH
            place += width
            if entries > np.uint64(len(data) - place):
                return lengths, place, _CUT_OFF
            lengths[record, column] = entries
            place += np.int64(entries) * size
        place += gap
        if place > len(data):
            return lengths, place, _CUT_OFF
    return lengths, place, _OK


def _gather(
    raw: NDArray[np.uint8], where: NDArray[np.int64], counts: NDArray[np.int64], item: np.dtype
) -> NDArray:
    """The numbers that lie at `where`, counts[i] of them each, one after another."""
    before = np.cumsum(counts) - counts
    places = np.repeat(where - before * item.itemsize, counts)
    places += np.arange(counts.sum()) * item.itemsize
    if not len(places):
        return np.empty(0, dtype=item)
    return sliding_window_view(raw, item.itemsize)[places].view(item).reshape(-1)
