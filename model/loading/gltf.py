"""glTF 2.0, binary (.glb) and JSON with embedded buffers (.gltf).

trimesh reads some valid files wrongly, and wrong ones silently. So the document is cut down to
what places triangles, that is checked (`gltf_plain`), and trimesh is given the result as one .glb.
"""

import json
import struct
from typing import Any

from model.errors import MalformedFile
from model.loading.gltf_accessors import cut_off, unsupported
from model.loading.gltf_plain import plain
from model.loading.scene import flatten, open_scene
from model.loading.triangles import Triangles

_JSON_CHUNK, _BINARY_CHUNK = 0x4E4F534A, 0x004E4942


def read_gltf(data: bytes) -> Triangles:
    """The triangles of a .gltf file whose buffers are data: URIs. Raises MalformedFile."""
    return _read(data, None)


def read_glb(data: bytes) -> Triangles:
    """The triangles of a .glb file. Raises MalformedFile."""
    return _read(*_split_chunks(data))


def _read(text: bytes, binary: bytes | None) -> Triangles:
    # Names may be in any encoding; they are not used.
    document = json.loads(text.decode("utf-8-sig", errors="replace").rstrip("\0"))
    if not isinstance(document, dict):
        raise MalformedFile("bad-header", "a glTF document must be a JSON object")
    return flatten(open_scene(_pack(*plain(document, binary)), "glb"))


def _split_chunks(data: bytes) -> tuple[bytes, bytes | None]:
    """The JSON chunk and the binary chunk; what follows them is passed over."""
    if len(data) < 20:
        raise cut_off(20, len(data))
    version = struct.unpack_from("<I", data, 4)[0]
    if version != 2:
        raise unsupported(f"binary glTF version {version} is not read, only 2")
    kind, document, position = _chunk(data, 12)
    if kind != _JSON_CHUNK:
        raise MalformedFile("bad-header", "the first chunk of a .glb must be its JSON document")
    while position + 8 <= len(data):
        kind, content, position = _chunk(data, position)
        if kind == _BINARY_CHUNK:
            return document, content
    return document, None


def _chunk(data: bytes, position: int) -> tuple[int, bytes, int]:
    """Kind and content of the chunk at `position`, and where the next one begins."""
    length, kind = struct.unpack_from("<2I", data, position)
    end = position + 8 + length
    if end > len(data):
        raise cut_off(end, len(data))
    return kind, data[position + 8 : end], end


def _pack(document: dict[str, Any], buffer: bytes) -> bytes:
    """A .glb file."""
    text = json.dumps(document).encode()
    text += b" " * (-len(text) % 4)
    length = 12 + 8 + len(text) + 8 + len(buffer)
    return b"".join(
        (
            struct.pack("<4s2I", b"glTF", 2, length),
            struct.pack("<2I", len(text), _JSON_CHUNK),
            text,
            struct.pack("<2I", len(buffer), _BINARY_CHUNK),
            buffer,
        )
    )
