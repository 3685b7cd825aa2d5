"""Valid files of every format, and what hypothesis makes of them."""

import json
import re
from collections.abc import Callable
from dataclasses import dataclass

from hypothesis import strategies as st

from tests.model.loading import loading_builders as build

_NUMBER = re.compile(rb"-?[0-9]+(?:\.[0-9]+)?")
_NUMBERS = [b"0", b"-1", b"7", b"255", b"1e999", b"nan", b"1e-320", b"2.5", b"1_0", b"", b"null"]
_NUMBERS += [
    str(sign * 2**power + 1).encode() for power in (16, 31, 32, 63, 64) for sign in (1, -1)
]
_WORDS = [b"\0", b"\xff", b"\0\0\x80\x7f", b"\xff\xff\xff\x7f", b"\0\0\0\x80", b"\n", b" ", b"#"]
_WORDS += [b"\\\n", b"\r", b'"', b"{", b"]", b"<", b"/>", b"&", b"%", b"\xef\xbb\xbf", b"\xff\xfe"]


@dataclass(frozen=True)
class Seed:
    """A file's changeable part, and how a file is made of it. extension: the file's."""

    extension: str
    content: bytes
    whole: Callable[[bytes], bytes] = bytes


def _glb(text: bytes) -> bytes:
    return build.pack_glb_text(text, build.gltf_document()[1])


def _package(model: bytes) -> bytes:
    return build.threemf({"3D/3dmodel.model": model})


_GROUP = '<object id="2"><components><component objectid="1"/></components></object>'
_ITEM = '<item objectid="2" transform="1 0 0 0 1 0 0 0 1 5 0 0"/>'

SEEDS: dict[str, Seed] = {
    **{title: Seed(*spelling) for title, spelling in build.SPELLINGS.items()},
    # Behind a checksum or a length, changes would not get far.
    "document of a glb": Seed("glb", json.dumps(build.gltf_document()[0]).encode(), _glb),
    "model of a 3mf": Seed(
        "3mf", build.model_xml(build.mesh_xml() + _GROUP, _ITEM).encode(), _package
    ),
}


@st.composite
def mutations(draw: st.DrawFn, content: bytes) -> bytes:
    """The content with a few things in it changed."""
    for _ in range(draw(st.integers(1, 5))):
        content = draw(st.sampled_from(_CHANGES))(draw, content)
    return content


def _place(draw: st.DrawFn, content: bytes) -> int:
    return draw(st.integers(0, len(content)))


def _slice(draw: st.DrawFn, content: bytes) -> tuple[int, int]:
    start = _place(draw, content)
    return start, start + draw(st.integers(0, 100))


def _flip(draw: st.DrawFn, content: bytes) -> bytes:
    place = _place(draw, content)
    return content[:place] + bytes([draw(st.integers(0, 255))]) + content[place + 1 :]


def _cut(draw: st.DrawFn, content: bytes) -> bytes:
    return content[: _place(draw, content)]


def _drop(draw: st.DrawFn, content: bytes) -> bytes:
    start, end = _slice(draw, content)
    return content[:start] + content[end:]


def _splice(draw: st.DrawFn, content: bytes) -> bytes:
    """A piece of this file or another at another place, maybe many times."""
    source = draw(st.sampled_from([content, *(seed.content for seed in SEEDS.values())]))
    start, end = _slice(draw, source)
    place = _place(draw, content)
    return content[:place] + source[start:end] * draw(st.integers(1, 20)) + content[place:]


def _insert(draw: st.DrawFn, content: bytes) -> bytes:
    place = _place(draw, content)
    return content[:place] + draw(st.sampled_from(_WORDS)) + content[place:]


def _swap_number(draw: st.DrawFn, content: bytes) -> bytes:
    found = list(_NUMBER.finditer(content))
    if not found:
        return content
    number = draw(st.sampled_from(found))
    return content[: number.start()] + draw(st.sampled_from(_NUMBERS)) + content[number.end() :]


_CHANGES = [_flip, _cut, _drop, _splice, _insert, _swap_number, _swap_number]
