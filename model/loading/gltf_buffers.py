"""The buffers of a glTF file, all of them within it."""

import base64
import binascii
from collections.abc import Iterator
from urllib.parse import unquote_to_bytes

from meshconv3d.model.errors import MalformedFile
from meshconv3d.model.loading.gltf_document import Document, cut_off, item, natural
from meshconv3d.model.loading.text import quoted

_BLOCK = 2**20  # characters


class Buffers:
    """The bytes of each buffer of a document, decoded when they are first asked for.

    binary: the content of buffer 0 where that has no URI.
    """

    def __init__(self, document: Document, binary: bytes | None) -> None:
        self._document = document
        self._binary = binary
        self._decoded: dict[int, bytes] = {}

    def __getitem__(self, number: int) -> bytes:
        """At least as many bytes as the buffer declares. Raises MalformedFile."""
        if number not in self._decoded:
            self._decoded[number] = self._content(number)
        return self._decoded[number]

    def _content(self, number: int) -> bytes:
        buffer = item(self._document, "buffers", number)
        content = self._binary if number == 0 else None
        if "uri" in buffer:
            content = _decode(buffer["uri"])
        if content is None:
            raise MalformedFile("missing-data", "a buffer has neither data in the file nor a URI")
        declared = natural(buffer, "byteLength")
        if len(content) < declared:
            raise cut_off(declared, len(content))
        return content


def _decode(uri: object) -> bytes:
    """The bytes of a data: URI. No other is ever opened."""
    if not isinstance(uri, str) or not uri.startswith("data:"):
        raise MalformedFile(
            "external-reference",
            f"the geometry lies in another file ({quoted(uri)}), and other files are never opened; "
            "export as .glb, which holds everything in one file",
        )
    head, _, payload = uri.partition(",")
    raw = b"".join(_unquoted(payload))
    if not head.endswith(";base64"):
        return raw
    try:
        return base64.b64decode(raw)
    except binascii.Error as error:
        raise MalformedFile(
            "bad-data-uri", "a buffer's data: URI is no base64; export the file again"
        ) from error


def _unquoted(payload: str) -> Iterator[bytes]:
    """The payload piece by piece: each %xx takes many times its bytes."""
    start = 0
    while start < len(payload):
        end = start + _BLOCK
        escape = payload.find("%", end - 2, end)
        end = end if escape < 0 else escape  # never within one
        yield unquote_to_bytes(payload[start:end])
        start = end
