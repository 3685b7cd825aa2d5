"""Tensors of the inference protocol, read without a service."""

import json

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from meshconv3d.model.errors import MalformedFile
from meshconv3d.service.http.errors import TooLarge
from meshconv3d.service.http.tensors_in import MOST_JSON_BYTES, InferenceRequest, read_request
from meshconv3d.service.http.tensors_out import Output, answer


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
    _, found = read_request(head + binary, str(len(head)), most=5)
    assert found == {"mesh": elements}


@given(st.binary(max_size=200), st.none() | st.integers(-1, 200).map(str))
def test_no_bytes_do_worse_than_to_be_refused(body: bytes, length: str | None) -> None:
    with pytest.raises(MalformedFile, match="not a request of the inference protocol"):
        read_request(body, length, most=5)


def test_json_is_bounded() -> None:
    with pytest.raises(TooLarge) as refused:
        read_request(b" " * (MOST_JSON_BYTES + 1), None, most=5)
    assert refused.value.limit == MOST_JSON_BYTES


def test_values_are_little_endian_and_in_a_row() -> None:
    outputs = {
        "scores": Output("scores", np.array([[1.0, -2.5]], ">f4").astype(np.float32)),
        "unknown": Output("unknown", np.array([True, False])),
        "class": Output("class", ["é", ""]),
    }
    request = InferenceRequest(inputs=[], parameters={"binary_data_output": True})
    body, length = answer(request, "any", outputs)
    assert body[length:] == b"\0\0\x80\x3f\0\0\x20\xc0" + b"\1\0" + b"\2\0\0\0\xc3\xa9\0\0\0\0"
