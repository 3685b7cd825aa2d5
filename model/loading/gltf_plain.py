"""A glTF document cut down to its placed triangles, every index and length in it checked."""

import base64
import binascii
import re
from typing import Any
from urllib.parse import unquote_to_bytes

from model.errors import MalformedFile
from model.loading.gltf_accessors import (
    check_indices,
    check_positions,
    cut_off,
    index,
    item,
    only,
    unsupported,
)

Document = dict[str, Any]

_TRIANGLES, _STRIP, _FAN = 4, 5, 6
_PLACEMENT = ("matrix", "translation", "rotation", "scale", "children")
# Required extensions that leave the triangles as they are, or that are read.
_HARMLESS = re.compile(
    "KHR_materials_.*|(KHR|EXT|MSFT)_texture_.*|KHR_lights_punctual|KHR_mesh_quantization"
    "|KHR_animation_pointer|KHR_xmp.*"
)


def plain(document: Document, binary: bytes | None) -> tuple[Document, bytes]:
    """An equal document without names, materials, cameras, curves, …; and its one buffer.

    binary: the content of buffer 0 where that has no URI. Raises MalformedFile.
    """
    _check_version(document)
    _check_extensions(document)
    accessors: dict[int, int] = {}  # number in the document to number in the plain one
    meshes = [_mesh(mesh, document, accessors) for mesh in document.get("meshes", [])]
    nodes, roots = _nodes(document, meshes)
    chosen = [item(document, "accessors", number) for number in accessors]
    views: dict[int, int] = {}
    for accessor in chosen:
        views.setdefault(accessor["bufferView"], len(views))
    offsets, buffer = _one_buffer(document, binary, views)
    return {
        "asset": {"version": "2.0"},
        "scene": 0,
        "scenes": [{"nodes": roots}],
        "nodes": nodes,
        "meshes": meshes,
        "accessors": [
            only(accessor, ("byteOffset", "componentType", "count", "type"))
            | {"bufferView": views[accessor["bufferView"]]}
            for accessor in chosen
        ],
        "bufferViews": [_view(item(document, "bufferViews", old), offsets) for old in views],
        "buffers": [{"byteLength": len(buffer)}],
    }, buffer


def _check_version(document: Document) -> None:
    version = str(document.get("asset", {}).get("version", "2.0"))
    if version.partition(".")[0] != "2":
        raise unsupported(f"glTF version {version} is not read, only 2.x")


def _check_extensions(document: Document) -> None:
    required = map(str, document.get("extensionsRequired", []))
    unread = [name for name in required if not _HARMLESS.fullmatch(name)]
    if unread:
        raise unsupported(f"the file requires {', '.join(unread)}, which is not read")


def _mesh(mesh: Document, document: Document, accessors: dict[int, int]) -> Document:
    """A mesh with positions and indices of its triangles; their accessors join `accessors`."""
    primitives = []
    for primitive in mesh["primitives"]:
        mode = primitive.get("mode", _TRIANGLES)
        if mode == _FAN:
            raise unsupported("triangle fans are not read")
        if mode not in (_TRIANGLES, _STRIP) or "POSITION" not in primitive["attributes"]:
            continue  # points, lines, or nothing to draw
        position = primitive["attributes"]["POSITION"]
        corners = check_positions(document, position)
        kept = {
            "mode": mode,
            "attributes": {"POSITION": accessors.setdefault(position, len(accessors))},
        }
        if "indices" in primitive:
            corners = check_indices(document, primitive["indices"])
            kept["indices"] = accessors.setdefault(primitive["indices"], len(accessors))
        if mode == _TRIANGLES and corners % 3:
            raise MalformedFile(
                "bad-face", f"a list of triangles has {corners} corners, no multiple of three"
            )
        primitives.append(kept)
    return {"primitives": primitives}


def _nodes(document: Document, meshes: list[Document]) -> tuple[list[Document], list[int]]:
    """The nodes as far as they place triangles, and the roots of the scene."""
    nodes: list[Document] = []
    for node in document.get("nodes", []):
        kept = only(node, _PLACEMENT)
        if "mesh" in node and meshes[index(node["mesh"], len(meshes), "meshes")]["primitives"]:
            kept["mesh"] = node["mesh"]
        nodes.append(kept)
    if not nodes:
        # A library of meshes that nothing places: take each as it is.
        nodes = [{"mesh": number} for number, mesh in enumerate(meshes) if mesh["primitives"]]
    children = [child for node in nodes for child in node.get("children", [])]
    if document.get("scenes"):
        roots = item(document, "scenes", document.get("scene", 0)).get("nodes", [])
    else:
        below = set(children)
        roots = [number for number in range(len(nodes)) if number not in below]
    _check_tree(len(nodes), roots + children)
    return nodes, roots


def _check_tree(nodes: int, descents: list[int]) -> None:
    """That each node is reached once at most: as a root of the scene or as a child of one node."""
    for number in descents:
        index(number, nodes, "nodes")
    if len(set(descents)) < len(descents):
        raise MalformedFile(
            "bad-scene", "a node has two parents or is its own ancestor; nodes must form a tree"
        )


def _one_buffer(
    document: Document, binary: bytes | None, views: dict[int, int]
) -> tuple[dict[int, int], bytes]:
    """Where each buffer that is used begins in the one that joins them; and that one."""
    offsets: dict[int, int] = {}
    parts: list[bytes] = []
    end = 0
    for view in views:
        number = item(document, "bufferViews", view)["buffer"]
        if number in offsets:
            continue
        part = _content(item(document, "buffers", number), binary if number == 0 else None)
        offsets[number] = end
        parts += [part, b"\0" * (-len(part) % 4)]
        end += len(part) + len(parts[-1])
    return offsets, b"".join(parts)


def _content(buffer: Document, binary: bytes | None) -> bytes:
    content = _decode(buffer["uri"]) if "uri" in buffer else binary
    if content is None:
        raise MalformedFile("missing-data", "a buffer has neither data in the file nor a URI")
    if len(content) < buffer["byteLength"]:
        raise cut_off(buffer["byteLength"], len(content))
    return content


def _decode(uri: str) -> bytes:
    """The bytes of a data: URI. No other is ever opened."""
    if not uri.startswith("data:"):
        raise MalformedFile(
            "external-reference",
            f"the geometry lies in another file ({uri[:100]!r}), and other files are never opened; "
            "export as .glb, which holds everything in one file",
        )
    head, _, payload = uri.partition(",")
    raw = unquote_to_bytes(payload)
    if not head.endswith(";base64"):
        return raw
    try:
        return base64.b64decode(raw)
    except binascii.Error as error:
        raise MalformedFile(
            "bad-data-uri", f"a buffer's data: URI is no base64 ({error}); export the file again"
        ) from error


def _view(view: Document, offsets: dict[int, int]) -> Document:
    return only(view, ("byteLength", "byteStride")) | {
        "buffer": 0,
        "byteOffset": offsets[view["buffer"]] + view.get("byteOffset", 0),
    }
