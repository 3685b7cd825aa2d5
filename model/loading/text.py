"""Text as bytes, and kernels that read the numbers in it.

A text that is scanned ends in a line feed, so that no kernel runs past its end. White space
separates words. `number` converts decimals of up to 19 digits. It leaves all other words (longer
numbers, `nan`, words that are no number) to `convert`, which calls Python's `float`, so that every
number has the value that `float` gives it.
"""

import re
from codecs import BOM_UTF8, BOM_UTF16_BE, BOM_UTF16_LE

import numpy as np
from numpy.typing import NDArray

from meshconv3d.model.errors import MalformedFile
from meshconv3d.model.jit import inlined, kernel

_SHOWN = 60  # characters of a file's content in a message
_WORD = re.compile(rb"\S+")
_PADDING = b"\0", b"\x1a"

LINE_FEED, MINUS, PLUS, DOT, HASH, ZERO, NINE = b"\n-+.#09"
_EXPONENT = b"e"[0]
LOWER = 32  # the bit in which "E" and "e" differ
# A word that is left to `convert`: a NaN whose other bits are the place of the word.
_LEFT, _PLACE = 0x7FF8 << 48, 2**48 - 1

_FULL = np.uint64(10**18)  # and one more digit fit into 64 bits
_WHOLE = 2**53  # floats below are exact where they are whole
_TENS = 10.0 ** np.arange(23)
# The first 128 bits of the powers of ten, in two columns of 64.
_LEAST, _MOST = -342, 308


def _leading_bits(power: int) -> tuple[int, int]:
    scaled = 10**power << 1400 if power >= 0 else (1 << 2600) // 10**-power
    bits = scaled >> (scaled.bit_length() - 128)
    return bits >> 64, bits & (2**64 - 1)


_POWERS = np.array([_leading_bits(power) for power in range(_LEAST, _MOST + 1)], dtype=np.uint64)


def as_utf8(data: bytes) -> bytes:
    """The same text in UTF-8, where the bytes begin with the byte-order mark of UTF-16."""
    if data.startswith((BOM_UTF16_LE, BOM_UTF16_BE)):
        return data.decode("utf-16", errors="replace").encode()
    return data


def plain_text(data: bytes) -> bytes:
    """The text without byte-order mark and padding, every line ended by one LF.

    It stays bytes: names may be in any encoding, and everything that is read is ASCII.
    Raises MalformedFile when there are zero bytes in it.
    """
    data = data.removeprefix(BOM_UTF8)
    if data.endswith(_PADDING):
        data = data.rstrip(b"".join(_PADDING) + b" \t\r\n")
    if not data.endswith(b"\n"):
        data += b"\n"
    zero = data.find(b"\0")
    if zero >= 0:
        raise MalformedFile(
            "not-text",
            f"byte {zero} is zero, which no text holds; the file is damaged or of another format",
        )
    if b"\r" in data:
        data = data.replace(b"\r\n", b"\n").replace(b"\r", b"\n")
    return data


def quoted(content: object) -> str:
    """Content of a file for a message: quoted and shortened."""
    if isinstance(content, bytes):
        content = content[: _SHOWN + 1].decode("latin-1")
    shown = repr(content[: _SHOWN + 1] if isinstance(content, str) else content)
    return shown if len(shown) <= _SHOWN else shown[:_SHOWN] + "…"


def quoted_line(text: bytes, place: int) -> str:
    """The line around a place for a message: quoted and shortened."""
    start = text.rfind(b"\n", 0, place) + 1
    return quoted(text[start : text.index(b"\n", place)].strip())


def convert(text: bytes, numbers: NDArray[np.float64]) -> None:
    """Fill in the numbers that `number` left out. Raises MalformedFile where one is none."""
    flat = numbers.reshape(-1)
    (left,) = np.nonzero(np.isnan(flat))
    places = flat[left].view(np.int64) & _PLACE
    flat[left] = [parsed(text, place) for place in places.tolist()]


def parsed(text: bytes, place: int) -> float:
    """The number at a place, by Python's `float`. Raises MalformedFile where there is none."""
    found = _WORD.match(text, place)
    word = found[0] if found else b""
    try:
        if b"_" not in word:  # Python reads 1_000 as a thousand
            return float(word)
    except ValueError:
        pass
    raise MalformedFile(
        "bad-number",
        f"{quoted(word)} stands where a number is expected, in the line {quoted_line(text, place)}",
    )


@inlined
def is_space(character):
    """Whether a byte separates words."""
    return character == 32 or 9 <= character <= 13


@inlined
def next_in_line(text, place):
    """The place of the next word of the line, or of the line feed."""
    while text[place] != LINE_FEED and is_space(text[place]):
        place += 1
    return place


@kernel
def next_word(text, place, comments):
    """The place of the next word, or the end of the text.

    comments: whether # begins one, before a word.
    """
    while place < len(text):
        if comments and text[place] == HASH:
            place = line_end(text, place)
        elif not is_space(text[place]):
            break
        place += 1
    return place


@inlined
def word_end(text, place):
    """The place after a word."""
    while not is_space(text[place]):
        place += 1
    return place


@inlined
def line_end(text, place):
    """The place of the line feed."""
    while text[place] != LINE_FEED:
        place += 1
    return place


@kernel
def number(text, place):
    """The word at a place as a float64, and the place after it.

    A word that is left to `convert` is a NaN that holds its place.
    """
    start = place
    negative = text[place] == MINUS
    if negative or text[place] == PLUS:
        place += 1
    mantissa, power, some, character = np.uint64(0), 0, False, text[place]
    for fraction in range(2):
        first = place
        while ZERO <= character <= NINE and mantissa < _FULL:
            mantissa = mantissa * np.uint64(10) + np.uint64(character - ZERO)
            place += 1
            character = text[place]
        some |= place > first
        if fraction:
            power = first - place
        elif character == DOT:
            place += 1
            character = text[place]
        else:
            break
    if some and character | LOWER == _EXPONENT:
        place += 1
        down = text[place] == MINUS
        if down or text[place] == PLUS:
            place += 1
        exponent, some = 0, False
        while ZERO <= text[place] <= NINE:
            exponent = min(exponent * 10 + text[place] - ZERO, 10_000)
            place += 1
            some = True
        power += -exponent if down else exponent
    if some and is_space(text[place]):
        value, known = _scaled(mantissa, power)
        if known:
            return -value if negative else value, place
    return np.int64(_LEFT | start).view(np.float64), word_end(text, place)


@kernel
def _scaled(mantissa, power):
    """The float nearest to mantissa x 10^power, and whether it is known.

    The algorithm of Eisel and Lemire ("Number parsing at a gigabyte per second", 2021). The few
    numbers that it cannot decide, and those below the smallest normal float, are left out.
    """
    if mantissa < _WHOLE and -22 <= power <= 22:  # both are floats, without rounding
        ten = _TENS[abs(power)]
        return (mantissa * ten if power > 0 else mantissa / ten), True
    if mantissa == 0:
        return 0.0, True
    if not _LEAST <= power <= _MOST:
        return 0.0, False
    exponent = ((217_706 * power) >> 16) + 1087  # 217706 / 2^16 is log2(10)
    while mantissa >> np.uint64(63) == 0:
        mantissa <<= np.uint64(1)
        exponent -= 1
    factor = _POWERS[power - _LEAST]
    high, low = _product(mantissa, factor[0])
    below = np.uint64(0x1FF)  # the bits that are rounded
    if high & below == below and low + mantissa < mantissa:
        carry, rest = _product(mantissa, factor[1])
        low += carry
        high += np.uint64(low < carry)
        if high & below == below and low + np.uint64(1) == 0 and rest + mantissa < mantissa:
            return 0.0, False
    top = high >> np.uint64(63)
    exponent -= 1 - np.int64(top)
    rounded = high >> (top + np.uint64(9))
    if low == 0 and high & below == 0 and rounded & np.uint64(3) == 1:
        return 0.0, False  # half-way between two floats
    rounded = (rounded + (rounded & np.uint64(1))) >> np.uint64(1)
    if exponent < 1 or exponent > 2046:
        return 0.0, False
    return np.ldexp(np.float64(rounded), np.int32(exponent - 1075)), True


@kernel
def _product(a, b):
    """The upper and lower 64 bits of the product of two uint64."""
    half, ones = np.uint64(32), np.uint64(0xFFFF_FFFF)
    low = (a >> half) * (b & ones) + ((a & ones) * (b & ones) >> half)
    middle = (a & ones) * (b >> half) + (low & ones)
    return (a >> half) * (b >> half) + (low >> half) + (middle >> half), a * b
