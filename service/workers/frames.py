"""Values on a stream from process to process: each is a length and a pickle of so many bytes."""

import pickle
import struct
from typing import Any, BinaryIO

LENGTH = struct.Struct("!Q")


def framed(value: object) -> tuple[bytes, bytes]:
    """What goes on the stream for a value, in two pieces."""
    content = pickle.dumps(value, pickle.HIGHEST_PROTOCOL)
    return LENGTH.pack(len(content)), content


def read_frame(stream: BinaryIO) -> Any:
    """The next value, which is waited for. Raises EOFError where there is none any more."""
    (length,) = LENGTH.unpack(_read(stream, LENGTH.size))
    return value_of(_read(stream, length))


def value_of(content: bytes) -> Any:
    """The value that bytes are."""
    return pickle.loads(content)


def _read(stream: BinaryIO, count: int) -> bytes:
    content = stream.read(count)
    if len(content) < count:
        raise EOFError
    return content
