"""Hostile OBJ."""

import math
from collections.abc import Iterator

from tests.hostile.catalogue import Catalogue, replaced
from tests.model.loading import loading_builders as build

FILES = Catalogue("box.obj")

_BOX = build.obj()
_POINTS = build.rows(build.VERTICES, "v ").encode()
_FACE = b"f 1 3 4"


def _with_face(text: bytes) -> bytes:
    return _BOX + text + b"\n"


def _with_vertex(text: bytes) -> bytes:
    return replaced(_BOX, b"v 0.0 0.0 0.0", b"v " + text)


def _wheel(spokes: int) -> Iterator[bytes]:
    yield b"v 0 0 1\n"
    for spoke in range(spokes):
        angle = 2 * math.pi * spoke / spokes
        yield b"v %.9f %.9f 0\n" % (math.cos(angle), math.sin(angle))
    for spoke in range(spokes):
        yield b"f 1 %d %d\n" % (spoke + 2, (spoke + 1) % spokes + 2)


def _star(corners: int, turns: int = 1) -> bytes:
    """One polygon around the origin, whose corners lie now farther out, now nearer."""
    points = ((1 + corner % 2, 2 * math.pi * turns * corner / corners) for corner in range(corners))
    lines = [b"v %.9f %.9f 0\n" % (r * math.cos(a), r * math.sin(a)) for r, a in points]
    return b"".join(lines) + b"f " + b" ".join(b"%d" % (n + 1) for n in range(corners)) + b"\n"


FILES.add("points alone", _POINTS, "no-faces")
FILES.add("a curve alone", _POINTS + b"l 1 2 3 4\n", "no-faces")
FILES.add("a spline surface", _POINTS + b"cstype bezier\nsurf 0 1 0 1 1 2 3 4\nend\n", "no-faces")
FILES.add("faces of two corners", _POINTS + b"f 1 2\nf 3 4\n", "no-faces")
FILES.add("faces without vertices", b"v\n" + _FACE + b"\n", "bad-vertex")
FILES.add("cut in a vertex", _BOX[: _BOX.index(b"f") - 6], "bad-vertex")
FILES.add("reference 0", replaced(_BOX, _FACE, b"f 0 3 4"), "index-out-of-range")
FILES.add("reference past the end", replaced(_BOX, _FACE, b"f 1 3 9"), "index-out-of-range")
FILES.add("reference before the start", replaced(_BOX, _FACE, b"f -9 3 4"), "index-out-of-range")
FILES.add("the least integer", _with_face(b"f 1 2 -9223372036854775808"), "bad-face")
FILES.add("a reference of 30 digits", _with_face(b"f 1 2 " + b"9" * 30), "bad-face")
FILES.add("a reference of 5000 digits", _with_face(b"f 1 2 " + b"9" * 5000), "bad-face")
FILES.add("a reference with an underscore", _with_face(b"f 1 2 0_3"), "bad-face")
FILES.add("words for references", _with_face(b"f one two three"), "bad-face")
FILES.add("a NaN", _with_vertex(b"nan 0 0"), "non-finite-vertices")
FILES.add("a number past all floats", _with_vertex(b"1e400 0 0"), "non-finite-vertices")
FILES.add(
    "an extent past all floats",
    _with_vertex(b"-1.7e308 0 0") + b"v 1.7e308 0 0\nf 1 2 9\n",
    "extent-overflow",
)
FILES.add("all in one point", b"v 1 1 1\n" * 3 + b"f 1 2 3\n", "zero-extent")
FILES.add("a flood of vertices that are none", lambda: b"v\n" * 2_000_000, "bad-vertex")
FILES.add("a flood of lines", lambda: _BOX + b"\n" * 4_000_000, None)
FILES.add("a flood of lone CRs", lambda: b"\r" * 4_000_000 + _BOX.replace(b"\n", b"\r"), None)
FILES.add("a flood of comments", lambda: b"#\n" * 2_000_000 + _BOX, None)
FILES.add("a line of 4 MB", lambda: _BOX + b"f" + b" 1" * 2_000_000 + b"\n", None)
FILES.add("a line of spaces", lambda: _BOX + b" " * 4_000_000 + b"x\n", None)
FILES.add("a line continued for 4 MB", lambda: _BOX + b"f" + b" 1 \\\n" * 800_000 + b"\n", None)
FILES.add("4 MB of backslashes", lambda: b"v " + b"\\" * 4_000_000 + b"\n" + _BOX, "bad-number")
FILES.add("a vertex of 300 000 faces", lambda: b"".join(_wheel(300_000)), None)
FILES.add("a concave polygon of 140 000 corners", lambda: _star(140_000), "too-many-ear-steps")
FILES.add("a polygon that crosses itself everywhere", lambda: _star(2_001, turns=1_000), None)
FILES.add(
    "60 000 materials",
    lambda: _BOX + b"".join(b"usemtl m%d\nf 1 2 3\n" % number for number in range(60_000)),
    None,
)
FILES.add("files to run and include", b"csh id\ncall secret.obj 1\n" + _BOX, None)
FILES.add("a material of another folder", b"mtllib ../../../../etc/passwd\n" + _BOX, None)
FILES.add("a material at an address", b"mtllib http://127.0.0.1:9/a.mtl\n" + _BOX, None)
FILES.add("a zero byte", replaced(_BOX, b" 3 ", b" \x003 "), "not-text")
FILES.add("UTF-16 with its mark", _BOX.decode().encode("utf-16"), None)
FILES.add("UTF-16 without its mark", _BOX.decode().encode("utf-16-le"), "not-text")
FILES.add("UTF-16 cut in a character", _BOX.decode().encode("utf-16")[:-1], "bad-face")
FILES.add("mixed encodings", b"\xef\xbb\xbf# \xff\xfe caf\xe9 \xf0\x9f\n" + _BOX, None)
