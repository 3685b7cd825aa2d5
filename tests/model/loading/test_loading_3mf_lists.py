"""Lists of vertices and triangles in 3MF: a kernel reads them as the XML parser does."""

import re
from collections import Counter

import loading_builders as build
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from meshconv3d.model.errors import MeshError
from meshconv3d.model.loading import Limits
from meshconv3d.model.loading.threemf import model as threemf_model
from meshconv3d.model.loading.threemf.model import ModelPart, Object
from tests.hostile.mutations import mutations

PLAIN = build.model_xml(build.mesh_xml() + build.mesh_xml(identifier="2"))
FIRST = '<vertex x="0.0" y="0.0" z="0.0"/>'
PREFIXED = re.sub(r"(</?)(\w+)", r"\1core:\2", PLAIN.replace("xmlns=", "xmlns:core="))

SPELLINGS = {
    "plain": PLAIN,
    "on lines": PLAIN.replace("<vertex", "\r\n\t <vertex").replace(" y=", "\n  y="),
    "single quotes": PLAIN.replace('"', "'"),
    "another order": re.sub(r"<vertex (\S+) (\S+) (\S+)/>", r"<vertex \3 \1 \2 />", PLAIN),
    "more attributes": PLAIN.replace(' v1="', ' pid="7" p1="a > b" v1="'),
    "a prefix": PREFIXED,
    "a comment": PLAIN.replace(FIRST, f"<!-- {FIRST} > {FIRST} -->{FIRST}"),
    "a comment with a list": PLAIN.replace(FIRST, f"<!-- <vertices>{FIRST}</vertices> -->{FIRST}"),
    "a comment before the lists": PLAIN.replace("<mesh>", f"<!-- <vertices>{FIRST} --><mesh>"),
    "a comment that begins a list": PLAIN.replace(
        "<vertices>", "<vertices><!-- <vertices>" + FIRST + "-->"
    ),
    "text that is none": PLAIN.replace("<vertices>", f"<vertices><![CDATA[<vertices>{FIRST}]]>"),
    "an instruction": PLAIN.replace("<vertices>", f"<vertices><?a > {FIRST}?>"),
    "an entity": PLAIN.replace('x="1.0"', 'x="&#49;"'),
    "elements with ends": PLAIN.replace("/>", "></vertex>", 1).replace('y="2.0"', 'y=" 2 "'),
    "an empty list": PLAIN.replace("<mesh>", "<mesh><vertices/><vertices ></vertices>"),
    "another namespace": PLAIN.replace(
        "<mesh>", f'<a xmlns="b"><vertices>{FIRST}</vertices></a><mesh>'
    ),
    "elements of another namespace": PLAIN.replace(
        "<vertices>", '<vertices><vertex xmlns="b" x="7" y="7" z="7"/>'
    ),
    "numbers": PLAIN.replace('"3.0"', '"3e0"').replace('"2.0"', '"2.00000000000000000001"'),
    "a number of none": PLAIN.replace('x="1.0"', 'x="1.0.0"', 1),
    "an attribute twice": PLAIN.replace('x="1.0"', 'x="1.0" x="1.0"', 1),
    "an attribute less": PLAIN.replace('x="1.0"', "", 1),
    "no spaces": PLAIN.replace(' y="', 'y="', 1),
    "quotes that differ": PLAIN.replace('x="1.0"', "x=\"1.0'", 1),
    "no end": PLAIN[: PLAIN.index("</triangles>")],
    "NaN": PLAIN.replace('x="1.0"', 'x="nan"', 1),
    "an index of a fraction": PLAIN.replace('v1="0"', 'v1="0.5"', 1),
    "an index past all integers": PLAIN.replace('v1="0"', 'v1="1e300"', 1),
}


def read(text: bytes, size: int) -> list | str:
    """What the objects of a model hold, or the fault. size: of the blocks that it comes in."""
    blocks = [text[start : start + size] for start in range(0, len(text), size)]
    try:
        part = ModelPart("a.model", str, Counter(), Limits()).read(blocks)
        return [found for one in part.objects.values() for found in rows(one)]
    except MeshError as error:
        return error.fault


def rows(one: Object) -> tuple:
    return one.vertices.rows().tobytes(), one.triangles.rows().tobytes()


@pytest.fixture
def by_parser(monkeypatch):
    """Reads without the kernel."""

    def parsed(text: bytes) -> list | str:
        with monkeypatch.context() as patch:
            patch.setattr(threemf_model, "_LIST", re.compile(b"(?!)"))
            return read(text, 1000)

    return parsed


@pytest.mark.parametrize("title", SPELLINGS)
def test_the_kernel_reads_what_the_parser_reads(title, by_parser):
    text = SPELLINGS[title].encode()
    expected = by_parser(text)
    for size in (1, 7, 64, len(text)):
        assert read(text, size) == expected


def test_most_spellings_are_models():
    found = [read(text.encode(), 2**16) for text in SPELLINGS.values()]
    assert sum(isinstance(one, list) and len(one) == 4 for one in found) >= 18


@given(data=st.data())
def test_any_change_is_read_alike(data):
    text = data.draw(mutations(PLAIN.encode()))
    fast = read(text, data.draw(st.sampled_from([50, 2**16])))
    pattern, threemf_model._LIST = threemf_model._LIST, re.compile(b"(?!)")
    try:
        slow = read(text, 1000)
    finally:
        threemf_model._LIST = pattern
    # Where two things are wrong, either is told; and the kernel takes attributes that come twice.
    assert (
        fast == slow or slow == "bad-document" or (isinstance(fast, str) and isinstance(slow, str))
    )


def test_a_kernel_reads_the_usual_form(monkeypatch):
    """The handlers of single vertices are for what is unusual."""
    seen = []
    monkeypatch.setattr(ModelPart, "_vertex", lambda *_: seen.append(1))
    monkeypatch.setattr(ModelPart, "_triangle", lambda *_: seen.append(1))
    for title in (
        "plain",
        "on lines",
        "single quotes",
        "another order",
        "more attributes",
        "a prefix",
    ):
        assert len(read(SPELLINGS[title].encode(), 2**16)) == 4
    assert not seen
    objects = read(SPELLINGS["plain"].encode(), 2**16)
    assert not isinstance(objects, str)
    assert np.frombuffer(objects[0]).max() == 3
