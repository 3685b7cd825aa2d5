"""What the text formats share: plain bytes with plain line ends, and points from lines."""

from codecs import BOM_UTF8, BOM_UTF16_BE, BOM_UTF16_LE

import numpy as np
from numpy.typing import NDArray

from model.errors import MalformedFile


def plain_text(data: bytes) -> bytes:
    """The text without byte-order mark and padding, every line ended by one LF.

    It stays bytes: names may be in any encoding, and everything that is read is ASCII.
    Raises MalformedFile when there are zero bytes in it.
    """
    if data.startswith((BOM_UTF16_LE, BOM_UTF16_BE)):
        data = data.decode("utf-16").encode()
    data = data.removeprefix(BOM_UTF8).rstrip(b"\0\x1a \t\r\n")
    zero = data.find(b"\0")
    if zero >= 0:
        raise MalformedFile(
            "not-text",
            f"byte {zero} is zero, which no text holds; the file is damaged or of another format",
        )
    if b"\r" in data:
        data = data.replace(b"\r\n", b"\n").replace(b"\r", b"\n")
    return data + b"\n"


def points(lines: list[bytes], what: str) -> NDArray[np.float64]:
    """V x 3: the first three numbers of each line, whatever follows them.

    what: the name of such a line in messages. Raises MalformedFile when a line has fewer.
    """
    if not lines:
        return np.empty((0, 3))
    if not any(map(bytes.strip, lines)):
        raise MalformedFile("bad-vertex", f"no {what} of {len(lines)} holds a number")
    try:
        table = np.loadtxt(lines, usecols=(0, 1, 2), ndmin=2, comments=None, encoding="latin-1")
    except ValueError as error:
        raise MalformedFile(
            "bad-vertex", f"each {what} must begin with three numbers x y z: {error}"
        ) from error
    if len(table) != len(lines):
        raise MalformedFile(
            "bad-vertex", f"{len(lines) - len(table)} of {len(lines)} {what}s hold no numbers"
        )
    return table


def numbers(text: bytes) -> NDArray[np.float64]:
    """All numbers of a text, separated by white space. Raises ValueError for anything else."""
    return np.array(text.split(), dtype=np.float64)
