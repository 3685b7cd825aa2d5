"""Tensors of the Open Inference Protocol: in JSON, or as binary data behind it."""

import asyncio
import base64
import binascii
import json
import struct
from collections.abc import Awaitable, Callable, Mapping
from dataclasses import dataclass
from typing import Annotated, Any

import msgspec
from msgspec import Meta, Struct, field
from numpy.typing import NDArray

from meshconv3d.service.http.problems import RequestError
from meshconv3d.service.http.uploads import too_many_meshes

# Larger meshes come as binary data, which need not be decoded.
MAX_JSON_BYTES = 4 * 1024 * 1024
# Decoding this much JSON takes so long that it is done off the event loop.
MANY_BYTES = 256 * 1024
# Strings in the JSON of a request beside the elements of its tensors: names, keys, parameters.
MAX_OTHER_STRINGS = 1000

# The header that says how much of a body is JSON, where binary data follows.
JSON_LENGTH = "Inference-Header-Content-Length"

# What stands before each element of binary data: its length in bytes.
LENGTH = struct.Struct("<I")

Name = Annotated[str, Meta(max_length=256)]


class InputParameters(Struct):
    """Parameters of an input; others are ignored."""

    binary_data_size: int = 0
    content_type: str = ""


class Input(Struct):
    """A BYTES tensor of a request: its data, or the size of its share of the binary data."""

    name: Name
    shape: Annotated[list[int], Meta(min_length=1, max_length=1)]
    datatype: Name
    parameters: InputParameters = field(default_factory=InputParameters)
    data: list[str] = []


class OutputParameters(Struct):
    """Parameters of a requested output; others are ignored."""

    binary_data: bool | None = None
    classification: int | None = None


class RequestedOutput(Struct):
    """A tensor that is asked for."""

    name: Name
    parameters: OutputParameters = field(default_factory=OutputParameters)


class RequestParameters(Struct):
    """Parameters of a request; others are ignored."""

    binary_data_output: bool = False


class InferenceRequest(Struct):
    """The JSON of a request."""

    inputs: Annotated[list[Input], Meta(max_length=8)]
    outputs: Annotated[list[RequestedOutput], Meta(max_length=8)] | None = None
    id: Name | None = None
    parameters: RequestParameters = field(default_factory=RequestParameters)


_decoder = msgspec.json.Decoder(InferenceRequest)

# Gives the next so many bytes of the body, or all that is left.
Read = Callable[[int], Awaitable[bytes]]


async def read_request(
    read: Read, json_length: str | None, most: int
) -> tuple[InferenceRequest, dict[str, list[bytes]]]:
    """A request and the elements of its input tensors, by name.

    json_length: the header JSON_LENGTH, or None where the whole body is JSON; most: elements that a
    tensor may have.

    Raises RequestError for what is no such request, and for too much of it.
    """
    length = MAX_JSON_BYTES + 1 if json_length is None else _length(json_length)
    document = await read(min(length, MAX_JSON_BYTES + 1))
    if len(document) > MAX_JSON_BYTES:
        detail = f"the JSON of the request has more than {MAX_JSON_BYTES} bytes; send binary data"
        raise RequestError(413, "json-too-large", detail, MAX_JSON_BYTES)
    if json_length is not None and len(document) < length:
        raise malformed(f"{JSON_LENGTH} says {length} bytes, the body has {len(document)}")
    if len(document) > MANY_BYTES:
        request = await asyncio.to_thread(_decode, document, most)
    else:
        request = _decode(document, most)
    tensors: dict[str, list[bytes]] = {}
    for tensor in request.inputs:
        if tensor.name in tensors:
            raise malformed(f"there are two inputs {tensor.name!r}")
        tensors[tensor.name] = await _elements(tensor, read, most)
    if await read(1):
        raise malformed("the body goes on after the data of its inputs")
    return request, tensors


def _length(text: str) -> int:
    # Python reads no number of some thousand digits.
    if not (text.isascii() and text.isdigit() and len(text) < 20):
        raise malformed(f"{JSON_LENGTH} is no number of bytes")
    return int(text)


def _decode(document: bytes, most: int) -> InferenceRequest:
    # A string begins with a quote that no backslash precedes: at least as many as there are
    # strings, and twice as many in an honest request.
    strings = document.count(b'"') - document.count(b'\\"')
    if strings > 2 * (2 * most + MAX_OTHER_STRINGS):
        raise malformed(f"its JSON has more than {2 * most + MAX_OTHER_STRINGS} strings")
    try:
        return _decoder.decode(document)
    except (ValueError, RecursionError) as error:
        raise malformed(str(error)) from None


async def _elements(tensor: Input, read: Read, most: int) -> list[bytes]:
    """The elements of an input, read from the binary data where it has none in JSON."""
    name, [count] = tensor.name, tensor.shape
    if tensor.datatype != "BYTES" or count < 1:
        raise malformed(
            f"input {name!r} should be BYTES of shape [n], not {tensor.datatype} of [{count}]"
        )
    if count > most:
        raise too_many_meshes(most)
    if not tensor.data:
        return await _unpacked(name, count, tensor.parameters.binary_data_size, read)
    if tensor.parameters.binary_data_size:
        raise malformed(f"input {name!r} has both data and binary data")
    if len(tensor.data) != count:
        raise malformed(f"input {name!r} has {len(tensor.data)} elements, its shape says {count}")
    in_base64 = tensor.parameters.content_type == "base64"
    return [_decoded(name, text, in_base64) for text in tensor.data]


async def _unpacked(name: str, count: int, size: int, read: Read) -> list[bytes]:
    """`count` elements of `size` bytes of binary data, each behind its length in four bytes."""
    elements = []
    for _ in range(count):
        size -= LENGTH.size
        head = await read(LENGTH.size) if size >= 0 else b""
        if len(head) < LENGTH.size:
            break
        (length,) = LENGTH.unpack(head)
        size -= length
        elements.append(await read(length) if size >= 0 else b"")
        if size < 0 or len(elements[-1]) < length:
            raise malformed(f"the binary data of input {name!r} ends within an element")
    if size or len(elements) < count:
        raise malformed(f"the binary data of input {name!r} is not {count} elements")
    return elements


def _decoded(name: str, text: str, in_base64: bool) -> bytes:
    if not in_base64:
        return text.encode()
    try:
        return base64.b64decode(text, validate=True)
    except (binascii.Error, ValueError):
        raise malformed(f"an element of input {name!r} is not base64") from None


def malformed(reason: str) -> RequestError:
    """The error for what is no request of the protocol, with the reason."""
    return RequestError(400, "bad-request", f"not a request of the inference protocol: {reason}")


@dataclass(frozen=True)
class Output:
    """A tensor of an answer. values: float32, bool or texts, of any shape."""

    name: str
    values: NDArray

    def describe(self) -> dict[str, Any]:
        """Name, datatype and shape."""
        datatype = {"f": "FP32", "b": "BOOL"}.get(self.values.dtype.kind, "BYTES")
        return {"name": self.name, "datatype": datatype, "shape": list(self.values.shape)}

    def to_bytes(self) -> bytes:
        """The elements in a row, little-endian; each text behind its length."""
        if self.values.dtype.kind in "fb":
            return self.values.astype(self.values.dtype.newbyteorder("<")).tobytes()
        texts = [text.encode() for text in self.values.tolist()]
        return b"".join(LENGTH.pack(len(text)) + text for text in texts)


def answer(
    request: InferenceRequest, model: str, outputs: Mapping[str, Output]
) -> tuple[bytes, int | None]:
    """The body of an answer with the requested outputs, or all; and the length of its JSON in
    bytes where binary data follows, else None.

    Raises RequestError for a requested output that does not exist.
    """
    described, parts = [], []
    for wanted in request.outputs or [RequestedOutput(name) for name in outputs]:
        if wanted.name not in outputs:
            raise malformed(f"there is no output {wanted.name!r}, but {', '.join(outputs)}")
        if wanted.parameters.classification is not None:
            raise malformed("the parameter 'classification' is not supported; read 'class'")
        output, binary = outputs[wanted.name], wanted.parameters.binary_data
        entry = output.describe()
        if request.parameters.binary_data_output if binary is None else binary:
            parts.append(output.to_bytes())
            entry["parameters"] = {"binary_data_size": len(parts[-1])}
        else:
            entry["data"] = output.values.ravel().tolist()
        described.append(entry)
    document = {"model_name": model, "outputs": described}
    if request.id is not None:
        document["id"] = request.id
    head = json.dumps(document).encode()
    return b"".join([head, *parts]), len(head) if parts else None
