"""Numbers in text: each has the value that Python's float gives it, to the bit."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from meshconv3d.model.errors import MalformedFile
from meshconv3d.model.loading.text import convert, number

_DECIMALS = st.from_regex(
    r"[-+]?([0-9]{1,25}\.?[0-9]{0,25}|\.[0-9]{1,25})([eE][-+]?[0-9]{1,4})?",
    fullmatch=True,
    alphabet=st.characters(codec="ascii"),
)
_FLOATS = st.floats().map(repr)
_WORDS = st.text("0123456789+-.eE_naif#", min_size=1, max_size=12)


def read(words: list[str]) -> list[float]:
    """All words by the kernel, and by Python what that leaves."""
    text = (" ".join(words) + "\n").encode()
    numbers, place = [], 0
    for word in words:
        value, end = number(np.frombuffer(text, np.uint8), place)
        assert end == place + len(word)
        numbers.append(value)
        place = end + 1
    values = np.array(numbers)
    convert(text, values)
    return values.tolist()


@given(st.lists(st.one_of(_DECIMALS, _FLOATS), min_size=1))
def test_decimals_are_what_float_makes_of_them(words):
    assert list(map(repr, read(words))) == [repr(float(word)) for word in words]


@pytest.mark.parametrize(
    "last", ["4503599627370496.5", "9007199254740993", "2.2250738585072011e-308"]
)
@pytest.mark.parametrize("more", ["", "0", "00000000000000000000", "00000000000000000001"])
def test_numbers_half_way_between_two_floats(last, more):
    # Not in the exponent.
    mantissa, _, exponent = last.partition("e")
    word = mantissa + ("" if "." in mantissa else ".") + more + ("e" + exponent if exponent else "")
    assert read([word]) == [float(word)]


@given(_WORDS)
def test_words_are_numbers_where_float_says_so_but_for_underscores(word):
    try:
        expected = None if "_" in word else float(word)
    except ValueError:
        expected = None
    if expected is None:
        with pytest.raises(MalformedFile, match="where a number is expected"):
            read([word])
    else:
        assert repr(read([word])[0]) == repr(expected)
