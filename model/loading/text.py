"""What the text formats share: plain bytes with plain line ends, points and numbers from them."""

import re
from codecs import BOM_UTF8, BOM_UTF16_BE, BOM_UTF16_LE
from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from meshconv3d.model.errors import MalformedFile
from meshconv3d.model.loading.limits import Limits

_SHOWN = 60  # characters of a file's content in a message


def plain_text(data: bytes) -> bytes:
    """The text without byte-order mark and padding, every line ended by one LF.

    It stays bytes: names may be in any encoding, and everything that is read is ASCII.
    Raises MalformedFile when there are zero bytes in it.
    """
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


def as_utf8(data: bytes) -> bytes:
    """The same text in UTF-8, where the bytes begin with the byte-order mark of UTF-16."""
    if data.startswith((BOM_UTF16_LE, BOM_UTF16_BE)):
        return data.decode("utf-16", errors="replace").encode()
    return data


def blocks(text: bytes, limits: Limits) -> Iterator[bytes]:
    """The text in pieces of whole lines: words and lines take many times their bytes.

    text: of lines that end in LF. Raises LimitExceeded when one is too long.
    """
    start = 0
    while start < len(text):
        end = text.rfind(b"\n", start, start + limits.line_bytes + 1) + 1
        if not end:
            length = text.index(b"\n", start) - start
            limits.check("line_bytes", length, f"the file has a line of {length} bytes")
        yield text[start:end]
        start = end


def without_comments(text: bytes) -> bytes:
    """The lines up to their #."""
    return re.sub(rb"#[^\n]*", b"", text) if b"#" in text else text


def points(lines: list[bytes], what: str) -> NDArray[np.float64]:
    """V x 3: the first three numbers of each line, whatever follows them.

    what: the name of such a line in messages. Raises MalformedFile when a line has fewer.
    """
    if not lines:
        return np.empty((0, 3))
    try:
        if all(map(bytes.strip, lines)):
            table = np.loadtxt(lines, usecols=(0, 1, 2), ndmin=2, comments=None, encoding="latin-1")
            if len(table) == len(lines):
                return table
    except ValueError:
        pass
    bad = next((line for line in lines if not _begins_with_point(line)), lines[0])
    raise MalformedFile(
        "bad-vertex", f"each {what} must begin with three numbers x y z, unlike {quoted(bad)}"
    )


def numbers(text: bytes, limits: Limits) -> NDArray[np.float64]:
    """All numbers of a text, separated by white space. Raises MalformedFile for anything else."""
    values = np.empty((len(text) + 1) // 2)  # as many as can be, one digit each
    count = 0
    for block in blocks(text, limits):
        found = _floats(block)
        values[count : count + len(found)] = found
        count += len(found)
    return values[:count]


def quoted(content: object) -> str:
    """Something of a file as it stands in a message, shortened."""
    if isinstance(content, bytes):
        content = content[: _SHOWN + 1].decode("latin-1")
    shown = repr(content[: _SHOWN + 1] if isinstance(content, str) else content)
    return shown if len(shown) <= _SHOWN else shown[:_SHOWN] + "…"


def _begins_with_point(line: bytes) -> bool:
    words = line.split(maxsplit=3)[:3]
    return len(words) == 3 and all(map(_is_number, words))


def _floats(block: bytes) -> NDArray[np.float64]:
    words = block.split()
    try:
        values = np.array(words, dtype=np.float64)
    except ValueError:
        values = None
    # Python reads 1_000 as a thousand.
    if values is None or b"_" in block:
        bad = next(word for word in words if not _is_number(word))
        raise MalformedFile("bad-number", f"{quoted(bad)} stands where a number is expected")
    return values


def _is_number(word: bytes) -> bool:
    try:
        float(word)
    except ValueError:
        return False
    return b"_" not in word
