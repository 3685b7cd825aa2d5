"""Elements of records, as in PLY and OFF: from text or from bytes to arrays of numbers.

An element is a count of records of the same fields, each a number or a list of numbers that is
preceded by its length.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import NamedTuple

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
from meshconv3d.model.loading.triangles import coordinates

_COUNTED = {"vertex": "vertices", "face": "faces"}
_WHOLE = 2**53  # floats below are exact where they are whole

# What becomes of a field: one of these, or the column that its number fills.
_SKIP, _SKIP_LIST, _KEEP_LIST = -1, -2, -3
_OK, _CUT_OFF, _SHORT, _BAD_LENGTH, _BAD_INDEX = range(5)


@dataclass(frozen=True)
class Field:
    """One field of a record: a number, or with `count` a list that is preceded by its length.

    item, count: dtypes of the numbers and of the length; of no meaning in text. Those of a length,
    and of a list that is wanted, are integers.
    """

    name: str
    item: np.dtype
    count: np.dtype | None = None


@dataclass(frozen=True)
class Element:
    """`length` records of the same fields."""

    name: str
    length: int
    fields: tuple[Field, ...]


class Table(NamedTuple):
    """What is wanted of an element.

    numbers: length x N, in the order in which they are wanted. items, counts: of the list that is
    wanted, the items of all records one after another, sum(counts), and how many each has.
    """

    numbers: NDArray[np.float64]
    items: NDArray[np.int64]
    counts: NDArray[np.int64]


Wanted = Mapping[str, Sequence[str]]  # by the name of an element, of numbers and one list at most


def read_text(
    text: bytes,
    place: int,
    elements: Sequence[Element],
    wanted: Wanted,
    limits: Limits,
    *,
    comments: bool = False,
) -> tuple[dict[str, Table], int]:
    """What is wanted of elements of numbers as text, by their names, and the place after them.

    text: ends in a line feed; the elements begin at `place`.
    comments: whether # begins one.

    Each record has a line, in which further words are passed over; or else all words count, and
    lines do not. What is not wanted may be any words. The place is the end of the text where
    elements that are not wanted follow.

    Raises MalformedFile; LimitExceeded when there are too many vertices or faces.
    """
    scanned = np.frombuffer(text, np.uint8)

    def attempt(lines: bool) -> tuple[dict[str, Table], int]:
        def read(place: int, element: Element, names: Sequence[str]) -> tuple[Table, int]:
            return _read_words(text, place, element, names, limits, lines, comments)

        tables, end = _read_in_turn(read, place, elements, wanted, len(text))
        if not lines and next_word(scanned, end, comments) < len(text):
            raise MalformedFile(
                "bad-face",
                "numbers are left over after the last face; write one vertex or face a line",
            )
        return tables, end

    start = next_word(scanned, place, comments)
    line = text[start : text.find(b"\n", start)].split(maxsplit=3)
    fields = next((len(element.fields) for element in elements if element.length), 0)
    if len(line) < min(fields, 3):
        return attempt(lines=False)
    try:
        return attempt(lines=True)
    except MalformedFile as error:
        try:
            return attempt(lines=False)
        except MalformedFile:
            raise error from None


def read_binary(
    data: bytes, place: int, elements: Sequence[Element], wanted: Wanted, limits: Limits
) -> tuple[dict[str, Table], int]:
    """What is wanted of elements of bytes, and the place after them; see `read_text`."""

    def read(place: int, element: Element, names: Sequence[str]) -> tuple[Table, int]:
        return _read_bytes(data, place, element, names, limits)

    return _read_in_turn(read, place, elements, wanted, len(data))


def note_of_more(data: bytes, place: int) -> str:
    """A note where more than padding follows the last record; else nothing."""
    more = len(data[place:].strip(b"\0\x1a \t\r\n"))
    if not more:
        return ""
    return (
        f"The file goes on for {more} bytes after the records that its header declares: "
        "they were not read."
    )


def _read_in_turn(
    read: Callable[[int, Element, Sequence[str]], tuple[Table, int]],
    place: int,
    elements: Sequence[Element],
    wanted: Wanted,
    end: int,
) -> tuple[dict[str, Table], int]:
    tables: dict[str, Table] = {}
    for element in elements:
        if wanted.keys() <= tables.keys():
            return tables, end
        names = wanted.get(element.name, ())
        if element.length and element.fields:
            tables[element.name], place = read(place, element, names)
        else:
            nothing = np.empty(0, dtype=np.int64)
            tables[element.name] = Table(np.empty((0, len(names))), nothing, nothing)
    return tables, place


def _read_words(
    text: bytes,
    place: int,
    element: Element,
    wanted: Sequence[str],
    limits: Limits,
    lines: bool,
    comments: bool,
) -> tuple[Table, int]:
    """One element, and the place after it; `lines`: whether each record has a line of its own."""
    # A digit and white space for each field.
    _check_length(element, limits, 2 * len(element.fields), len(text) - place + 1)
    fields = list(element.fields)
    while lines and fields and fields[-1].name not in wanted:
        fields.pop()
    kinds = _kinds(fields, wanted)
    table = _empty(element.length, kinds, (len(text) - place) // 2)
    scanned = np.frombuffer(text, np.uint8)
    ended, place, items = _scan_words(scanned, place, kinds, lines, comments, *table)
    if ended in (_BAD_LENGTH, _BAD_INDEX):
        parsed(text, place)  # raises where the word is no number at all
    if ended != _OK:
        line = quoted_line(text, min(place, len(text) - 1))
        raise _error(ended, element, f", in the line {line}")
    convert(text, table.numbers)
    return table._replace(items=table.items[:items]), place


def _read_bytes(
    data: bytes, place: int, element: Element, wanted: Sequence[str], limits: Limits
) -> tuple[Table, int]:
    """One element, and the place after it."""
    fields, kinds = element.fields, _kinds(element.fields, wanted)
    least = sum((field.count or field.item).itemsize for field in fields)
    _check_length(element, limits, least, len(data) - place)
    kept = [
        field.item.itemsize for field, kind in zip(fields, kinds, strict=True) if kind < _SKIP_LIST
    ]
    table = _empty(element.length, kinds, (len(data) - place) // max(kept, default=1))
    columns = [(int(kind), fields[index], index) for index, kind in enumerate(kinds) if kind >= 0]
    if (kinds >= _SKIP).all():
        layout = np.dtype([(str(index), field.item) for index, field in enumerate(fields)])
        records = np.frombuffer(data, layout, element.length, place)
        for column, _, index in columns:
            table.numbers[:, column] = coordinates(records[str(index)])
        return table, place + least * element.length
    steps = [
        (kind, *_integer(field.count or field.item), *_integer(field.item))
        for field, kind in zip(fields, kinds, strict=True)
    ]
    raw, big = np.frombuffer(data, np.uint8), any(field.item.str[0] == ">" for field in fields)
    places = np.empty(table.numbers.shape, dtype=np.int64)
    ended, place, items = _scan_bytes(
        raw, place, np.array(steps), big, places, table.items, table.counts, element.length
    )
    if ended != _OK:
        raise _error(ended, element, "")
    for column, field, _ in columns:
        found = sliding_window_view(raw, field.item.itemsize)[places[:, column]]
        table.numbers[:, column] = coordinates(found.view(field.item)[:, 0])
    return table._replace(items=table.items[:items]), place


def _kinds(fields: Sequence[Field], wanted: Sequence[str]) -> NDArray[np.int64]:
    """What becomes of each field: the column of its number, _SKIP, _SKIP_LIST or _KEEP_LIST."""
    kinds = [
        (_KEEP_LIST if field.name in wanted else _SKIP_LIST)
        if field.count is not None
        else (wanted.index(field.name) if field.name in wanted else _SKIP)
        for field in fields
    ]
    return np.array(kinds, dtype=np.int64)


def _integer(dtype: np.dtype) -> tuple[int, int]:
    """Bytes of an integer, and whether it has a sign."""
    return dtype.itemsize, int(dtype.kind == "i")


def _empty(records: int, kinds: NDArray[np.int64], most_items: int) -> Table:
    """A table to fill in. What of it stays empty takes no memory."""
    keeps = int((kinds == _KEEP_LIST).any())
    items, counts = np.empty(keeps * most_items, np.int64), np.empty(keeps * records, np.int64)
    return Table(np.empty((records, np.count_nonzero(kinds >= 0))), items, counts)


def _check_length(element: Element, limits: Limits, least: int, there: int) -> None:
    """Raises MalformedFile where records of `least` bytes cannot be there, and LimitExceeded."""
    if least * element.length > there:
        raise _error(_CUT_OFF, element, "")
    if element.name in _COUNTED:
        limits.check(_COUNTED[element.name], element.length)


def _error(ended: int, element: Element, where: str) -> MalformedFile:
    """The error for the end that a scan came to."""
    name = quoted(element.name)
    if ended == _CUT_OFF:
        return MalformedFile(
            "truncated",
            f"the file declares {element.length} {name} records, but ends before the last; "
            "it is cut off, export or upload it again",
        )
    fault, what = {
        _SHORT: (
            f"bad-{element.name}" if element.name in _COUNTED else "bad-record",
            f"a {name} record has fewer numbers than it must have",
        ),
        _BAD_LENGTH: ("bad-face", f"a list in the {name} records has a length that cannot be"),
        _BAD_INDEX: ("bad-index", "a face names its vertices by something else than whole numbers"),
    }[ended]
    return MalformedFile(fault, f"{what}{where}; the file is damaged, export it again")


@kernel
def _scan_words(text, place, kinds, lines, comments, numbers, items, counts):
    """Fill in the table of an element of `read_text`, up to the first record that is wrong.

    kinds: what becomes of each field. Returns how the scan ended, where, and the number of items.
    """
    item = 0
    for record in range(len(numbers)):
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
                    numbers[record, kind] = value
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


@kernel
def _scan_bytes(data, place, steps, big, places, items, counts, length):
    """The same of an element of bytes that has lists; `places`: of the numbers, length x N.

    steps: of each field what becomes of it, then bytes and sign of its length, and of its items.
    big: whether numbers are big-endian.
    """
    item = 0
    for record in range(length):
        for kind, width, signed, size, negative in steps:
            entries = 1
            if kind <= _SKIP_LIST:
                if place + width > len(data):
                    return _CUT_OFF, place, item
                entries = _whole(data, place, width, signed, big)
                place += width
            if entries < 0:
                return _BAD_LENGTH, place, item
            if entries > (len(data) - place) // size:
                return _CUT_OFF, place, item
            if kind >= 0:
                places[record, kind] = place
            elif kind == _KEEP_LIST:
                counts[record] = entries
                for entry in range(entries):
                    items[item + entry] = _whole(data, place + entry * size, size, negative, big)
                item += entries
            place += entries * size
    return _OK, place, item


@kernel
def _whole(data, place, width, signed, big):
    """The integer at a place, of so many bytes."""
    value = np.uint64(0)
    for byte in range(width):
        value = (value << np.uint64(8)) | data[place + (byte if big else width - 1 - byte)]
    if not signed or width == 8:
        return np.int64(value)
    top = np.int64(1) << (8 * width - 1)
    return (np.int64(value) ^ top) - top
