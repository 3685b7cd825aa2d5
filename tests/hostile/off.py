"""Hostile OFF."""

from tests.hostile.catalogue import Catalogue, replaced
from tests.model.loading import loading_builders as build

FILES = Catalogue("box.off")

_BOX = build.off()
_COUNTS = b"8 12 0"
_FACE = b"\n3 0 2 3\n"


def _with_counts(text: bytes) -> bytes:
    return replaced(_BOX, _COUNTS, text)


def _with_face(text: bytes) -> bytes:
    return replaced(_BOX, _FACE, b"\n" + text + b"\n")


FILES.add("the keyword alone", b"OFF\n", "bad-header")
FILES.add("counts cut off", b"OFF\n8 ", "bad-header")
FILES.add("cut in the vertices", _BOX[:40], "truncated")
FILES.add("cut in the faces", _BOX[: -len(_FACE)], "truncated")
FILES.add("10^12 faces", _with_counts(b"8 1000000000000 0"), "truncated")
FILES.add("10^12 vertices", _with_counts(b"1000000000000 12 0"), "truncated")
FILES.add("a count of 5000 digits", _with_counts(b"8 " + b"9" * 5000 + b" 0"), "bad-header")
FILES.add("a negative count", _with_counts(b"8 -12 0"), "bad-header")
FILES.add("no faces", build.off([]), "no-faces")
FILES.add("nothing at all", b"OFF\n0 0 0\n", "no-faces")
FILES.add("index -1", _with_face(b"3 0 2 -1"), "index-out-of-range")
FILES.add("index past the end", _with_face(b"3 0 2 8"), "index-out-of-range")
FILES.add("index 10^30", _with_face(b"3 0 2 1e30"), "bad-index")
FILES.add("index NaN", _with_face(b"3 0 2 nan"), "bad-index")
FILES.add("index 2.5", _with_face(b"3 0 2 2.5"), "bad-index")
FILES.add("-3 corners", _with_face(b"-3 0 2 3"), "bad-face")
FILES.add("10^15 corners", _with_face(b"1000000000000000 0 2 3"), "bad-face")
FILES.add(
    "10^15 corners in one line",
    _with_face(b"1000000000000000 0 2 3").replace(b"\n", b" "),
    "truncated",
)
FILES.add("words", _with_face(b"three zero two three"), "bad-number")
FILES.add("an underscore", _with_face(b"3 0 2 0_3"), "bad-number")
FILES.add("vertices of two numbers", replaced(_BOX, b"0.0 0.0 0.0\n", b"0.0 0.0\n"), "bad-face")
FILES.add("a NaN", replaced(_BOX, b"0.0 0.0 0.0", b"nan 0.0 0.0"), "non-finite-vertices")
FILES.add(
    "coordinates of 1e308",
    _BOX.replace(b"1.0", b"1.7e308").replace(b"\n0.0", b"\n-1.7e308"),
    "extent-overflow",
)
FILES.add("all in one point", b"OFF\n3 1 0\n" + b"1 1 1\n" * 3 + b"3 0 1 2\n", "zero-extent")
FILES.add("four coordinates", build.off(header="4OFF"), "unsupported-feature")
FILES.add("text that is called binary", build.off(header="OFF BINARY"), "truncated")
FILES.add("binary without counts", b"OFF BINARY\n\0\0", "bad-header")
FILES.add("binary of -1 vertices", b"OFF BINARY\n" + b"\xff" * 12, "bad-header")
FILES.add(
    "binary of 2^31 - 1 faces", b"OFF BINARY\n" + b"\0\0\0\x08\x7f\xff\xff\xff" * 9, "truncated"
)
FILES.add("a line of 4 MB", lambda: _BOX + b"1 " * 2_000_000, None)
FILES.add("a flood of comments", lambda: b"#\n" * 2_000_000 + _BOX, None)
FILES.add("a flood of lines", lambda: b"OFF" + b"\n" * 4_000_000 + _BOX[4:], None)
FILES.add(
    "a flood of lines before nothing", lambda: b"OFF" + b"\n" * 4_000_000 + b"x", "bad-header"
)
FILES.add("UTF-16", _BOX.decode().encode("utf-16"), None)
FILES.add("a zero byte", replaced(_BOX, b"3 0 2", b"3 \x000 2"), "not-text")
