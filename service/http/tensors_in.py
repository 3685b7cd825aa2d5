"""Requests of the Open Inference Protocol: tensors in JSON, or as binary data behind it."""

import base64
import binascii
import struct
from collections.abc import Iterator

from pydantic import BaseModel, Field, ValidationError

from meshconv3d.model.errors import MalformedFile
from meshconv3d.service.http.errors import TooLarge, TooManyMeshes

# Reading JSON keeps everyone waiting; meshes of this size and more come as binary data.
MOST_JSON_BYTES = 4 * 1024 * 1024

# The header that says how much of a body is JSON, where binary data follows.
JSON_LENGTH = "Inference-Header-Content-Length"

# What stands before each element of binary data: how many bytes it has.
LENGTH = struct.Struct("<I")

Parameters = dict[str, bool | int | float | str]


class Input(BaseModel):
    """A BYTES tensor of a request: its data, or the size of its share of the binary data."""

    name: str
    shape: list[int]
    datatype: str
    parameters: Parameters = {}
    data: list[str] = Field(default=[], fail_fast=True)


class RequestedOutput(BaseModel):
    """A tensor that is asked for."""

    name: str
    parameters: Parameters = {}


class InferenceRequest(BaseModel):
    """What stands in the JSON of a request."""

    id: str | None = None
    parameters: Parameters = {}
    inputs: list[Input] = Field(max_length=8)
    outputs: list[RequestedOutput] | None = Field(default=None, max_length=8)


def read_request(
    body: bytes, json_length: str | None, most: int
) -> tuple[InferenceRequest, dict[str, list[bytes]]]:
    """A request and the elements of its input tensors, by name.

    json_length: what the header JSON_LENGTH says, or None where all is JSON;
    most: how many elements a tensor may have.

    Raises MalformedFile for what is no such request, TooLarge for too much of it.
    """
    length = len(body) if json_length is None else _length(json_length, len(body))
    if length > MOST_JSON_BYTES:
        raise TooLarge(
            "json-too-large",
            MOST_JSON_BYTES,
            f"the JSON of the request has more than {MOST_JSON_BYTES} bytes; send meshes as "
            "binary tensor data",
        )
    try:
        request = InferenceRequest.model_validate_json(body[:length])
    except ValidationError as error:
        first = error.errors(include_input=False, include_url=False)[0]
        raise malformed(f"{'.'.join(map(str, first['loc']))}: {first['msg']}") from None
    binary = memoryview(body)[length:]
    elements: dict[str, list[bytes]] = {}
    for tensor in request.inputs:
        if tensor.name in elements:
            raise malformed(f"there are two inputs {tensor.name!r}")
        share = _share(tensor, binary)
        binary = binary[len(share) :]
        elements[tensor.name] = _elements(tensor, share, most)
    if binary:
        raise malformed(f"{len(binary)} bytes of binary data belong to no input")
    return request, elements


def _length(text: str, most: int) -> int:
    # Python reads no number of some thousand digits.
    if not (text.isascii() and text.isdigit() and len(text) < 20 and int(text) <= most):
        raise malformed(f"{JSON_LENGTH} is not one of 0 to {most}")
    return int(text)


def _share(tensor: Input, binary: memoryview) -> memoryview:
    """The part of the binary data that is a tensor's own."""
    size = tensor.parameters.get("binary_data_size", 0)
    if not (isinstance(size, int) and 0 <= size <= len(binary)):
        raise malformed(f"input {tensor.name!r} claims binary data that is not there")
    return binary[:size]


def _elements(tensor: Input, share: memoryview, most: int) -> list[bytes]:
    name, shape = tensor.name, tensor.shape
    if tensor.datatype != "BYTES" or len(shape) != 1 or shape[0] < 1:
        raise malformed(
            f"input {name!r} should be BYTES of shape [n], not {tensor.datatype} of {shape}"
        )
    if shape[0] > most:
        raise TooManyMeshes(most)
    if not tensor.data:
        found = list(_unpacked(name, share))
    elif share:
        raise malformed(f"input {name!r} has both data and binary data")
    else:
        in_base64 = tensor.parameters.get("content_type") == "base64"
        found = [_decoded(name, text, in_base64) for text in tensor.data]
    if len(found) != shape[0]:
        raise malformed(f"input {name!r} has {len(found)} elements, its shape says {shape[0]}")
    return found


def _unpacked(name: str, share: memoryview) -> Iterator[bytes]:
    """The elements of binary data, each behind its length in four bytes."""
    while share:
        if len(share) < LENGTH.size:
            raise malformed(f"the binary data of input {name!r} ends within a length")
        (length,) = LENGTH.unpack(share[: LENGTH.size])
        share = share[LENGTH.size :]
        if length > len(share):
            raise malformed(f"the binary data of input {name!r} ends within an element")
        yield bytes(share[:length])
        share = share[length:]


def _decoded(name: str, text: str, in_base64: bool) -> bytes:
    if not in_base64:
        return text.encode()
    try:
        return base64.b64decode(text, validate=True)
    except (binascii.Error, ValueError):
        raise malformed(f"an element of input {name!r} is not base64") from None


def malformed(reason: str) -> MalformedFile:
    """What is no request of the protocol, and why."""
    return MalformedFile("bad-request", f"not a request of the inference protocol: {reason}")
