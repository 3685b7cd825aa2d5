"""Tensors of the inference protocol, read without a service."""

import asyncio
import io
import json

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from meshconv3d.service.http.problems import RequestError
from meshconv3d.service.http.tensors import (
    MAX_JSON_BYTES,
    InferenceRequest,
    Output,
    RequestParameters,
    answer,
    read_request,
)

Elements = dict[str, list[bytes]]


def read(body: bytes, length: str | None) -> tuple[InferenceRequest, Elements]:
    """A request with at most five elements a tensor."""
    stream = io.BytesIO(body)

    async def take(count: int) -> bytes:
        return stream.read(count)

    return asyncio.run(read_request(take, length, most=5))


@given(st.lists(st.binary(max_size=20), min_size=1, max_size=5))
def test_binary_data_comes_as_it_was_sent(elements: list[bytes]) -> None:
    binary = b"".join(len(element).to_bytes(4, "little") + element for element in elements)
    mesh = {
        "name": "mesh",
        "datatype": "BYTES",
        "shape": [len(elements)],
        "parameters": {"binary_data_size": len(binary)},
    }
    head = json.dumps({"inputs": [mesh]}).encode()
    _, found = read(head + binary, str(len(head)))
    assert found == {"mesh": elements}


@given(st.binary(max_size=200), st.none() | st.integers(-1, 200).map(str))
def test_no_bytes_do_worse_than_to_be_refused(body: bytes, length: str | None) -> None:
    with pytest.raises(RequestError, match="not a request of the inference protocol"):
        read(body, length)


def test_json_is_bounded() -> None:
    with pytest.raises(RequestError) as refused:
        read(b" " * (MAX_JSON_BYTES + 1), None)
    assert refused.value.limit == MAX_JSON_BYTES


def of(**changes: object) -> bytes:
    """A request for one mesh as JSON, with changes to its input."""
    entry = {"name": "mesh", "datatype": "BYTES", "shape": [1], "data": ["v 0 0 0"]} | changes
    return json.dumps({"inputs": [entry]}).encode()


@pytest.mark.parametrize(
    ("body", "reason"),
    [
        (of(data=["a"] * 100_000), "strings"),
        (of(parameters=dict.fromkeys(map(str, range(100_000)), 0)), "strings"),
        (of(data=['\\"'] * 100_000), "strings"),
        (of(shape=[1] * 100_000), "length <= 1"),
        (of().replace(b"[1]", b"[1" + b"0" * 10_000 + b"]"), "out of range"),
        (of(name="n" * 300), "length <= 256"),
        (b'{"other":' + b"[" * 10_000, "recursion"),
        (b'{"inputs":[' + b"{}," * 100_000, "missing required field"),
        (b'{"inputs":[{"name":"\\ud800"}]}', "truncated"),
        (b"\xff", "malformed"),
    ],
)
def test_counts_and_nesting_are_bounded(body: bytes, reason: str) -> None:
    with pytest.raises(RequestError, match=reason):
        read(body, None)


def test_unknown_parameters_are_ignored() -> None:
    _, found = read(of(parameters={"other": [{}], "content_type": "text"}), None)
    assert found == {"mesh": [b"v 0 0 0"]}


def test_values_are_little_endian_and_in_a_row() -> None:
    outputs = {
        "scores": Output("scores", np.array([[1.0, -2.5]], ">f4").astype(np.float32)),
        "unknown": Output("unknown", np.array([True, False])),
        "class": Output("class", np.array(["é", ""])),
    }
    request = InferenceRequest(inputs=[], parameters=RequestParameters(binary_data_output=True))
    body, length = answer(request, "any", outputs)
    assert body[length:] == b"\0\0\x80\x3f\0\0\x20\xc0" + b"\1\0" + b"\2\0\0\0\xc3\xa9\0\0\0\0"
