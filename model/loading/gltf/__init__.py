"""glTF, binary (.glb) and JSON (.gltf), of the versions 1.0 and 2.0.

Read with NumPy: a general library would have to be guarded by the same checks of every index,
length and stride that reading takes.
"""

import json
import re
import struct
from collections.abc import Mapping
from contextlib import suppress

from meshconv3d.model.errors import MalformedFile
from meshconv3d.model.loading.gltf.arrays import Buffers, piece_name
from meshconv3d.model.loading.gltf.document import (
    Document,
    children,
    cut_off,
    entries,
    parse,
    unsupported,
    upgraded,
)
from meshconv3d.model.loading.gltf.scene import placed_surfaces
from meshconv3d.model.loading.limits import Limits
from meshconv3d.model.loading.scene import flatten
from meshconv3d.model.loading.text import quoted
from meshconv3d.model.loading.triangles import Triangles

_BLOCK = 2**20  # bytes
_LONGEST_URI = 2**12
_URI = re.compile(rb'"uri"\s*:\s*("(?!data:)(?:[^"\\]|\\.){1,%d}")' % _LONGEST_URI)
_PICTURES = (".png", ".jpg", ".jpeg", ".webp", ".avif", ".ktx2", ".basis", ".dds")
_JSON_CHUNK, _BINARY_CHUNK = 0x4E4F534A, 0x004E4942

# Extensions that a file may require: they are read, or leave the vertices where they are.
_READ = re.compile(
    "KHR_draco_mesh_compression|(KHR|EXT)_meshopt_compression|KHR_mesh_quantization"
    "|EXT_mesh_gpu_instancing|KHR_node_visibility|KHR_binary_glTF|WEB3D_quantized_attributes"
    "|(KHR|ADOBE|NV)_materials_.*|(KHR|EXT|MSFT|MPEG)_texture_.*|(KHR|EXT)_lights_.*"
    "|KHR_techniques_webgl|KHR_animation_pointer|KHR_interactivity|KHR_node_.*ability"
    "|(KHR|OMI)_(audio|physics).*|(KHR_xmp|MSFT_packing|VRM|AGI_|FB_).*|MSFT_lod|CESIUM_RTC"
    "|CESIUM_primitive_outline|EXT_mesh_(features|manifold)|EXT_(structural|feature)_metadata"
    "|EXT_instance_features"
)
# Extensions that move vertices and are not read: refused even where a file only uses them.
_UNREAD = re.compile("(?i:(mesh_compression_)?open3dgc).*|MPEG_(accessor_timed|mesh_linking)")


def read_gltf(data: bytes, limits: Limits, pieces: Mapping[str, bytes]) -> Triangles:
    """The triangles of a .gltf file. pieces: what its buffers may name, by relative paths.

    Raises MalformedFile and LimitExceeded.
    """
    return _read(data, None, limits, pieces)


def read_glb(data: bytes, limits: Limits, pieces: Mapping[str, bytes]) -> Triangles:
    """The triangles of a .glb file. Arguments and errors are those of `read_gltf`."""
    return _read(*_split_container(data), limits, pieces)


def piece_names(data: bytes, limits: Limits) -> list[str]:
    """Relative paths of the other files in which a .gltf or .glb may keep its buffers.

    They are looked for without parsing the JSON, which takes the interpreter's lock for longer than
    an event loop can wait. Names of pictures are left out, and paths that lead elsewhere.

    Raises LimitExceeded where it names too many.
    """
    names: dict[str, None] = {}
    count = 0
    end = len(data)
    if data.startswith(b"glTF"):  # its JSON alone, whose length both versions have here
        end = min(end, 20 + int.from_bytes(data[12:16], "little"))
    for start in range(0, end, _BLOCK):
        for found in _URI.finditer(data, start, min(start + _BLOCK + _LONGEST_URI, end)):
            count += 1
            limits.check("entries", count, "the file names too many others")
            with suppress(UnicodeDecodeError, json.JSONDecodeError, MalformedFile):
                name = piece_name(json.loads(found[1]))
                if not name.lower().endswith(_PICTURES):
                    names[name] = None
    return list(names)


def _read(
    text: bytes, binary: bytes | None, limits: Limits, pieces: Mapping[str, bytes]
) -> Triangles:
    document = _document(text, limits)
    _check_extensions(document)
    buffers = Buffers(document, binary, pieces, limits)
    return flatten(placed_surfaces(document, buffers, limits), limits)


def _document(text: bytes, limits: Limits) -> Document:
    """The document, in the form of glTF 2.0."""
    document = parse(text, limits)
    if isinstance(document.get("meshes"), dict):
        return upgraded(document)
    version = str(children(document, "asset").get("version", "2.0"))
    if version.partition(".")[0] != "2":
        raise unsupported(f"glTF version {quoted(version)} is not read, only 1.0 and 2.x")
    return document


def _check_extensions(document: Document) -> None:
    required = list(map(str, entries(document, "extensionsRequired")))
    used = list(map(str, entries(document, "extensionsUsed")))
    unread = [name for name in required if not _READ.fullmatch(name)]
    unread += [name for name in used if _UNREAD.fullmatch(name)]
    if unread:
        raise unsupported(f"the file requires {quoted(', '.join(unread))}, which is not read")


def _split_container(data: bytes) -> tuple[bytes, bytes | None]:
    """The JSON of a .glb, and its binary part, or None."""
    if len(data) < 20:
        raise cut_off(20, len(data))
    version = struct.unpack_from("<I", data, 4)[0]
    if version == 1:
        # KHR_binary_glTF: the JSON's length and format, the JSON, and all that follows.
        length, form = struct.unpack_from("<2I", data, 12)
        if form != 0:
            raise unsupported(f"binary glTF 1.0 with a scene of format {form} is not read, only 0")
        if 20 + length > len(data):
            raise cut_off(20 + length, len(data))
        return data[20 : 20 + length], data[20 + length :]
    if version != 2:
        raise unsupported(f"binary glTF version {version} is not read, only 1 and 2")
    kind, document, position = _chunk(data, 12)
    if kind != _JSON_CHUNK:
        raise MalformedFile("bad-header", "the first chunk of a .glb must be its JSON document")
    # The binary part, if there is one, is the second chunk; others are passed over.
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
