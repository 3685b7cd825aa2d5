"""Hostile glTF."""

import base64
import json
import struct
from collections.abc import Callable
from typing import Any

import numpy as np

from tests.hostile.catalogue import Catalogue
from tests.model.loading import loading_builders as build

FILES = Catalogue("box.glb")

_GLB = build.glb()
_JSON_END = 20 + struct.unpack_from("<I", _GLB, 12)[0]
_MATRIX = np.eye(4).ravel().tolist()


def _add(title: str, fault: str | None, change: Callable[[dict, bytes], bytes | None]) -> None:
    """A box whose document, and maybe data, `change` has changed."""

    def make() -> bytes:
        document, data = build.gltf_document()
        changed = change(document, data)
        return build.pack_glb(document, data if changed is None else changed)

    FILES.add(title, make, fault)


def _set(title: str, fault: str | None, kind: str, key: str, value: Any) -> None:
    """A box with another value in the first entry of a list of its document."""
    _add(title, fault, lambda document, _: document[kind][0].__setitem__(key, value))


def _replace(title: str, fault: str | None, key: str, value: Any) -> None:
    _add(title, fault, lambda document, _: document.__setitem__(key, value))


def _primitive(title: str, fault: str | None, **changes: Any) -> None:
    def change(document: dict, _: bytes) -> None:
        document["meshes"][0]["primitives"][0].update(changes)

    _add(title, fault, change)


def _without_view(document: dict, _: bytes) -> None:
    del document["accessors"][0]["bufferView"]


def _without_indices(document: dict, _: bytes) -> None:
    del document["meshes"][0]["primitives"][0]["indices"]


# The container
for _title, _end in {
    "header": 10,
    "first chunk's header": 15,
    "document": _JSON_END - 30,
    "second chunk's header": _JSON_END + 4,
    "data": len(_GLB) - 5,
}.items():
    _fault = "missing-data" if _title.startswith("second") else "truncated"
    FILES.add(f"cut in the {_title}", _GLB[:_end], _fault)
FILES.add("a chunk of 4 GB", _GLB[:12] + b"\xff" * 4 + _GLB[16:], "truncated")
FILES.add("version 1 of version 2", _GLB[:4] + b"\1\0\0\0" + _GLB[8:], "unsupported-feature")
FILES.add("version 3", _GLB[:4] + b"\3\0\0\0" + _GLB[8:], "unsupported-feature")
FILES.add("version 1 cut off", build.glb1()[:-300], "truncated")
FILES.add("version 1 of 4 GB", build.glb1()[:12] + b"\xff" * 4 + build.glb1()[16:], "truncated")
FILES.add("no document first", _GLB[:16] + b"BIN\0" + _GLB[20:], "bad-header")
FILES.add("no data", build.pack_glb(build.gltf_document()[0], b""), "truncated")

# The document
FILES.add("a list", b"[1, 2]", "format-mismatch", "box.gltf")
FILES.add("JSON cut off", build.gltf()[:-40], "bad-document", "box.gltf")
FILES.add("JSON in UTF-16", build.gltf().decode().encode("utf-16"), None, "box.gltf")
FILES.add("a million brackets", b'{"nodes":' + b"[" * 1_000_000, "bad-document", "box.gltf")
FILES.add("3 million values", b'{"nodes":[' + b"{}," * 1_500_000, "too-many-values", "box.gltf")
FILES.add("5000 digits", b'{"scene":' + b"9" * 5000 + b"}", "bad-number", "box.gltf")
FILES.add("an empty object", b"{}", "no-faces", "box.gltf")
for _key in ("scenes", "nodes", "meshes", "accessors", "bufferViews", "buffers", "asset"):
    for _value in ("text", 1, [None], [[1]]):
        _shown = json.dumps(_value)
        _replace(f"{_key} of {_shown}", "bad-document", _key, _value)

# Arrays
_set("a view that is null", "bad-number", "accessors", "bufferView", None)
_add("no view of its own", "unsupported-feature", _without_view)
_set("10^9 sparse rows", "bad-accessor", "accessors", "sparse", {"count": 10**9})
_set("10^12 vertices", "truncated", "accessors", "count", 10**12)
_set("10^4000 vertices", "truncated", "accessors", "count", 10**4000)
_set("-1 vertices", "bad-number", "accessors", "count", -1)
_set("vertices of a float count", "bad-number", "accessors", "count", 8.0)
_set("an accessor past its view", "truncated", "accessors", "byteOffset", 4)
_set("an accessor before its view", "bad-number", "accessors", "byteOffset", -4)
_set("a view before its buffer", "bad-number", "bufferViews", "byteOffset", -96)
_set("a view past its buffer", "truncated", "bufferViews", "byteLength", 10**6)
_set("a stride of -12", "bad-number", "bufferViews", "byteStride", -12)
_set("a stride of 0", "bad-accessor", "bufferViews", "byteStride", 0)
_set("a stride of 10^30", "truncated", "bufferViews", "byteStride", 10**30)
_set("a buffer longer than its data", "truncated", "buffers", "byteLength", 10**6)
_set("a component type that is none", "bad-accessor", "accessors", "componentType", 9999)
_set("a component type that is a list", "bad-number", "accessors", "componentType", [])
_set("a view that is none", "bad-reference", "accessors", "bufferView", 9)
_primitive("indices that are none", "bad-reference", indices=9)
_primitive("indices of positions", "bad-accessor", indices=0)
_primitive("points alone", "no-faces", mode=0)
_primitive("curves alone", "no-faces", mode=3)
_primitive("a mode that is none", "no-faces", mode=99)
_primitive("no positions", "no-faces", attributes={})
_add("no indices for eight corners", "bad-face", _without_indices)
_add("index past the end", "index-out-of-range", lambda _, data: data[:-2] + b"\xff\xff")
_add("NaN", "non-finite-vertices", lambda _, data: b"\xff" * 4 + data[4:])
_add("all in one point", "zero-extent", lambda _, data: bytes(96) + data[96:])

# References
for _uri in (
    "box.bin",
    "../../../../etc/passwd",
    "/etc/passwd",
    "file:///etc/passwd",
    "http://127.0.0.1:9/box.bin",
    "\\\\127.0.0.1\\share\\box.bin",
    "zip://box.zip!box.bin",
    "x" * 100_000,
):
    _set(f"a buffer at {_uri[:40]}", "external-reference", "buffers", "uri", _uri)
_set("a buffer at a number", "external-reference", "buffers", "uri", 7)
_set("no base64", "bad-data-uri", "buffers", "uri", "data:;base64,AAAAA")
_set("base64 that is too short", "truncated", "buffers", "uri", "data:;base64,AAAA")
_set("1 MB of escapes", "zero-extent", "buffers", "uri", "data:," + "%00" * 330_000)
_replace("an image at an address", None, "images", [{"uri": "http://127.0.0.1:9/a.png"}])
_replace("a required extension of nobody", "unsupported-feature", "extensionsRequired", ["ACME"])


# The scene
def _chain(length: int) -> Callable[[dict, bytes], None]:
    def change(document: dict, _: bytes) -> None:
        links: list[dict] = [{"children": [number + 1]} for number in range(length - 1)]
        document["nodes"] = [*links, {"mesh": 0}]

    return change


def _instances(count: int, primitives: int = 1, repeats: int = 1) -> Callable[[dict, bytes], bytes]:
    """Nodes that all place one mesh of equal primitives, whose faces repeat those of the box."""

    def change(document: dict, data: bytes) -> bytes:
        indices = data[96:] * repeats
        document["accessors"][1]["count"] = len(indices) // 2
        document["bufferViews"][1]["byteLength"] = len(indices)
        document["buffers"][0]["byteLength"] = 96 + len(indices)
        document["meshes"][0]["primitives"] *= primitives
        document["nodes"] = [{"mesh": 0, "name": "same"}] * count
        document["scenes"][0]["nodes"] = list(range(count))
        return data[:96] + indices

    return change


_add("a chain of 9000 nodes", None, _chain(9000))
_add("a chain of 30 000 nodes", "too-many-geometries", _chain(30_000))
_add("100 000 nodes", "too-many-geometries", _instances(100_000))
_add("9000 nodes of 1200 faces", "too-many-faces", _instances(9000, repeats=100))
_add("900 nodes of 1200 faces", "too-many-repeated-faces", _instances(900, repeats=100))
_add("9000 primitives of 1200 faces", "too-many-faces", _instances(1, 9000, 100))
_add("200 nodes of 200 primitives", "too-many-geometries", _instances(200, 200))
_add("5000 nodes of one name", None, _instances(5000))
_set("a node within itself", "bad-scene", "nodes", "children", [0])
_replace(
    "a cycle beside the scene",
    "bad-scene",
    "nodes",
    [{"mesh": 0}, {"children": [2, 2]}, {"children": [1]}],
)
_set("a child that is none", "bad-reference", "nodes", "children", [7])
_set("a negative child", "bad-number", "nodes", "children", [-1])
_set("a child that is text", "bad-number", "nodes", "children", ["0"])
_set("a mesh that is none", "bad-reference", "nodes", "mesh", 7)
_set("a scene of nothing", "no-faces", "scenes", "nodes", [])
_replace("a scene that is none", "bad-reference", "scene", 5)
_set("a matrix of 3 numbers", "bad-number", "nodes", "matrix", [1, 2, 3])
_set("a matrix of text", "bad-number", "nodes", "matrix", ["1"] * 16)
_set("a matrix of NaN", "bad-number", "nodes", "matrix", [*_MATRIX[:-1], float("nan")])
_set("a matrix of 10^400", "bad-number", "nodes", "matrix", [10**400, *_MATRIX[1:]])
_set("a rotation of zeros", "bad-number", "nodes", "rotation", [0, 0, 0, 0])
_set("a scale of zeros", "zero-extent", "nodes", "scale", [0, 0, 0])
_replace(
    "scales past all floats",
    "non-finite-vertices",
    "nodes",
    [{"children": [1], "scale": [1e200] * 3}, {"mesh": 0, "scale": [1e200] * 3}],
)


def _in_text(data: bytes) -> str:
    return "data:application/octet-stream;base64," + base64.b64encode(data).decode()


def _many_buffers() -> bytes:
    """2000 accessors that all see the whole of one buffer."""
    document, data = build.gltf_document()
    document["accessors"] += [document["accessors"][1]] * 2000
    document["meshes"][0]["primitives"] = [
        {"attributes": {"POSITION": 0}, "indices": number} for number in range(1, 2001)
    ]
    document["buffers"][0]["uri"] = _in_text(data)
    return json.dumps(document).encode()


FILES.add("2000 accessors over one buffer", _many_buffers, None, "box.gltf")


# What is packed
def _draco(header: bytes, corners: int = 36) -> Callable[[dict, bytes], bytes]:
    def change(document: dict, _: bytes) -> bytes:
        document["bufferViews"] = [{"buffer": 0, "byteLength": len(header)}]
        document["buffers"][0]["byteLength"] = len(header)
        document["accessors"][1]["count"] = corners
        document["meshes"][0]["primitives"][0]["extensions"] = {
            "KHR_draco_mesh_compression": {"bufferView": 0, "attributes": {"POSITION": 0}}
        }
        return header

    return change


_EDGEBREAKER = b"DRACO\2\2\1\1"
_MANY = b"\xff\xff\xff\xff\1"  # 2^29 - 1
_add("Draco that is nothing", "bad-draco", _draco(b""))
_add("Draco that is text", "bad-draco", _draco(b"hello" * 10))
_add("Draco of points", "bad-draco", _draco(b"DRACO\2\2\0\0" + bytes(40)))
_add("Draco of 2^29 faces", "bad-draco", _draco(_EDGEBREAKER + b"\0\0\0" + 3 * _MANY))
_add(
    "Draco of 2^29 faces behind metadata",
    "bad-draco",
    _draco(_EDGEBREAKER + b"\0\x80\0\1\1a\1b\0\0" + 3 * _MANY),
)
_add(
    "Draco of 2^29 values of metadata",
    "bad-draco",
    _draco(_EDGEBREAKER + b"\0\x80\0" + _MANY),
)
_add(
    "Draco of as many faces as declared",
    "too-many-faces",
    _draco(_EDGEBREAKER + b"\0\0\0" + 3 * _MANY, 3 * (2**29 - 1)),
)
_add("Draco in parts of version 1", "bad-draco", _draco(b"DRACO\1\1\1\1\0\0" + b"\xff" * 40))


def _meshopt(**changes: Any) -> Callable[[dict, bytes], bytes]:
    """Positions of zeros, with a control mode that takes no bytes for them."""

    def change(document: dict, data: bytes) -> bytes:
        packed = b"\xa1" + b"\xaa" * 3 + bytes(24)
        view = {"buffer": 0, "byteOffset": len(data), "byteLength": len(packed), "count": 8}
        view |= {"byteStride": 12, "mode": "ATTRIBUTES"} | changes
        document["bufferViews"][0]["extensions"] = {"KHR_meshopt_compression": view}
        document["buffers"][0]["byteLength"] += len(packed)
        return data + packed

    return change


_add("meshopt of zeros", "zero-extent", _meshopt())
_add("meshopt of 4 million elements", "too-many-unpacked-bytes-per-byte", _meshopt(count=4_000_000))
_add("meshopt of 10^12 elements", "too-many-unpacked-bytes", _meshopt(count=10**12))
_add("meshopt of elements of 0 bytes", "unsupported-feature", _meshopt(byteStride=0))
_add("meshopt of fewer elements", "truncated", _meshopt(count=4))
_add("meshopt in a mode of a list", "unsupported-feature", _meshopt(mode=[]))
_add("meshopt past its buffer", "truncated", _meshopt(byteLength=10**6))


# What moves vertices
def _moved(node: dict, **more: Any) -> Callable[[dict, bytes], bytes]:
    """Accessor 2 is of as many rows as the box has vertices, 3 of a single matrix of zeros."""

    def change(document: dict, data: bytes) -> bytes:
        _, data = build.add_array(document, data, np.full((8, 4), 9), "VEC4", 5121)
        _, data = build.add_array(document, data, np.zeros((1, 16)), "MAT4", 5126)
        document["nodes"][0] |= node
        attributes = {"JOINTS_0": 2, "WEIGHTS_0": 2}
        document["meshes"][0]["primitives"][0]["attributes"] |= attributes
        document |= more
        return data

    return change


def _instanced(count: int) -> Callable[[dict, bytes], None]:
    def change(document: dict, _: bytes) -> None:
        document["accessors"].append({"componentType": 5126, "count": count, "type": "VEC3"})
        attributes = {"attributes": {"TRANSLATION": 2}}
        document["nodes"][0]["extensions"] = {"EXT_mesh_gpu_instancing": attributes}

    return change


def _morphed(document: dict, _: bytes) -> None:
    """20 000 targets, all over the same positions."""
    document["meshes"][0]["weights"] = [1] * 20_000
    document["meshes"][0]["primitives"][0]["targets"] = [{"POSITION": 0}] * 20_000


_add("a skin that is none", "bad-reference", _moved({"skin": 0}))
_add("a skin without joints", "bad-reference", _moved({"skin": 0}, skins=[{}]))
_add("joints that are none", "bad-reference", _moved({"skin": 0}, skins=[{"joints": [0]}]))
_add("a joint that is no node", "bad-reference", _moved({"skin": 0}, skins=[{"joints": [9]}]))
_add(
    "10 000 joints with one matrix",
    "bad-accessor",
    _moved({"skin": 0}, skins=[{"joints": [0] * 10_000, "inverseBindMatrices": 3}]),
)
_add(
    "inverse bind matrices that are positions",
    "bad-accessor",
    _moved({"skin": 0}, skins=[{"joints": [0], "inverseBindMatrices": 0}]),
)
_add("200 000 instances", "too-many-repeated-faces", _instanced(200_000))
_add("10^6 instances", "too-many-instances", _instanced(1_000_000))
_add("10^12 instances", "too-many-instances", _instanced(10**12))
_add("20 000 targets of morphs", "too-many-geometries", _morphed)
_set("weights of morphs that are text", "bad-number", "meshes", "weights", ["1"])
