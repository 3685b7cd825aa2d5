"""Elements of records: a count of equal records whose fields are numbers or lists of numbers.

That is the data model of PLY. Text is read as such records too, each number a float64, so that
binary and ASCII files have one reader.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from meshconv3d.model.errors import MalformedFile
from meshconv3d.model.loading.text import quoted

Buffer = bytes | memoryview


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


def whole(length: float, element: Element) -> int:
    """The length of a list. Raises MalformedFile when it is none."""
    if not (0 <= length < 2**63 and length == int(length)):
        raise MalformedFile(
            "bad-face",
            f"a list in the {quoted(element.name)} records declares {length} entries; "
            "the file is damaged",
        )
    return int(length)


def cut_off(element: Element) -> MalformedFile:
    """The error for data that ends within the element."""
    return MalformedFile(
        "truncated",
        f"the file declares {element.length} {quoted(element.name)} records, "
        "but ends before the last; it is cut off, export or upload it again",
    )
