"""glTF 2.0, binary (.glb) and JSON with embedded buffers (.gltf).

Read by NumPy: what has to be checked before trimesh may be given a file (every index, length and
stride, and how often each is placed) is nearly all that reading one takes.
"""

import re
import struct

from meshconv3d.model.errors import MalformedFile
from meshconv3d.model.loading.gltf_buffers import Buffers
from meshconv3d.model.loading.gltf_document import (
    Document,
    children,
    cut_off,
    entries,
    item,
    parse,
    unsupported,
)
from meshconv3d.model.loading.gltf_meshes import Surface, surfaces
from meshconv3d.model.loading.gltf_nodes import placed_meshes
from meshconv3d.model.loading.limits import Limits
from meshconv3d.model.loading.scene import Matrix, flatten
from meshconv3d.model.loading.text import quoted
from meshconv3d.model.loading.triangles import Triangles

_JSON_CHUNK, _BINARY_CHUNK = 0x4E4F534A, 0x004E4942
# Required extensions that leave the triangles as they are, or that are read.
_HARMLESS = re.compile(
    "KHR_materials_.*|(KHR|EXT|MSFT)_texture_.*|KHR_lights_punctual|KHR_mesh_quantization"
    "|KHR_animation_pointer|KHR_xmp.*"
)


def read_gltf(data: bytes, limits: Limits) -> Triangles:
    """The triangles of a .gltf file whose buffers are data: URIs.

    Raises MalformedFile and LimitExceeded.
    """
    return _read(data, None, limits)


def read_glb(data: bytes, limits: Limits) -> Triangles:
    """The triangles of a .glb file. Raises MalformedFile and LimitExceeded."""
    return _read(*_split_chunks(data), limits)


def _read(text: bytes, binary: bytes | None, limits: Limits) -> Triangles:
    document = parse(text, limits)
    _check_version(document)
    _check_extensions(document)
    buffers = Buffers(document, binary)
    meshes: dict[int, list[Surface]] = {}
    placed: list[tuple[Surface, Matrix]] = []
    primitives = 0
    for number, matrix in placed_meshes(document, limits):
        if number not in meshes:
            meshes[number] = surfaces(item(document, "meshes", number), document, buffers)
        placed += [(surface, matrix) for surface in meshes[number]]
        primitives += sum(len(surface.primitives) for surface in meshes[number])
        limits.check("geometries", primitives)
    return flatten(placed, limits)


def _check_version(document: Document) -> None:
    version = str(children(document, "asset").get("version", "2.0"))
    if version.partition(".")[0] != "2":
        raise unsupported(f"glTF version {quoted(version)} is not read, only 2.x")


def _check_extensions(document: Document) -> None:
    required = map(str, entries(document, "extensionsRequired"))
    unread = [name for name in required if not _HARMLESS.fullmatch(name)]
    if unread:
        raise unsupported(f"the file requires {quoted(', '.join(unread))}, which is not read")


def _split_chunks(data: bytes) -> tuple[bytes, bytes | None]:
    """The JSON chunk and the binary chunk, if that is the second; the others are passed over."""
    if len(data) < 20:
        raise cut_off(20, len(data))
    version = struct.unpack_from("<I", data, 4)[0]
    if version != 2:
        raise unsupported(f"binary glTF version {version} is not read, only 2")
    kind, document, position = _chunk(data, 12)
    if kind != _JSON_CHUNK:
        raise MalformedFile("bad-header", "the first chunk of a .glb must be its JSON document")
    if position + 8 <= len(data):
        kind, content, _ = _chunk(data, position)
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
