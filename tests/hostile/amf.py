"""Hostile AMF."""

from tests.hostile.catalogue import Catalogue, replaced
from tests.model.loading import loading_builders as build

FILES = Catalogue("box.amf")

_BOX = build.amf()


def _constellation(identifier: int, *objects: int) -> str:
    instances = "".join(f'<instance objectid="{one}"/>' for one in objects)
    return f'<constellation id="{identifier}">{instances}</constellation>'


def _bomb() -> bytes:
    """Ten levels of ten instances each."""
    levels = "".join(_constellation(level + 1, *10 * [level]) for level in range(1, 11))
    return build.amf(more=levels)


FILES.add("a box", _BOX, None)
FILES.add("many instances of instances", _bomb, "too-many-geometries")
FILES.add(
    "constellations of each other",
    build.amf(more=_constellation(2, 3) + _constellation(3, 2)),
    None,
)
FILES.add(
    "nothing but constellations of each other",
    b"<amf>" + (_constellation(2, 3) + _constellation(3, 2)).encode() + b"</amf>",
    "bad-scene",
)
FILES.add("an instance of nothing", build.amf(more=_constellation(2, 9)), "bad-reference")
FILES.add("a DTD", replaced(_BOX, b"<amf", b'<!DOCTYPE a SYSTEM "/etc/passwd"><amf'), "bad-header")
FILES.add("a vertex without z", replaced(_BOX, b"<z>0.0</z>", b""), "bad-document")
FILES.add("a word for a number", replaced(_BOX, b"<x>0.0</x>", b"<x>one</x>"), "bad-number")
FILES.add("no index", replaced(_BOX, b"<v1>0</v1>", b"<v1>9</v1>"), "index-out-of-range")
FILES.add("a fraction as an index", replaced(_BOX, b"<v1>0</v1>", b"<v1>0.5</v1>"), "bad-number")
FILES.add(
    "an infinite angle",
    build.amf(more=_constellation(2, 1).replace("/>", "><rx>inf</rx></instance>")),
    "bad-number",
)
FILES.add("half of it", _BOX[: len(_BOX) // 2], "bad-document")
FILES.add(
    "numbers without end",
    lambda: replaced(_BOX, b"<x>", b"<x/>" * 3_000_000 + b"<x>"),
    "too-many-values",
)
FILES.add("an archive of something else", build.archive({"a.txt": "a"}), "format-mismatch")
FILES.add(
    "a deflate bomb",
    lambda: build.archive({"box.amf": _BOX + b" " * 2**24}),
    "too-many-unpacked-bytes-per-byte",
)
