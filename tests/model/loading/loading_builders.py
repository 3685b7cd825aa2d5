"""A box of 1 x 2 x 3 in every format, written without any library that is under test."""

import base64
import json
import struct
import zipfile
from collections.abc import Mapping
from io import BytesIO
from typing import Any

import numpy as np

AREA, VOLUME = 22.0, 6.0

VERTICES = np.array([(x, y, z) for z in (0, 3) for y in (0, 2) for x in (0, 1)], dtype=np.float64)
QUADS = np.array(
    [(0, 2, 3, 1), (4, 5, 7, 6), (0, 1, 5, 4), (2, 6, 7, 3), (0, 4, 6, 2), (1, 3, 7, 5)]
)
FACES = np.concatenate([QUADS[:, [0, 1, 2]], QUADS[:, [0, 2, 3]]])


def area(mesh) -> float:
    return float(np.linalg.norm(_normals(mesh), axis=1).sum() / 2)


def volume(mesh) -> float:
    """Signed: negative for a solid that is inside out."""
    return float((mesh.vertices[mesh.faces[:, 0]] * _normals(mesh)).sum() / 6)


def _normals(mesh):
    a, b, c = (mesh.vertices[mesh.faces[:, corner]] for corner in range(3))
    return np.cross(b - a, c - a)


def is_box(mesh, boxes=1) -> bool:
    return bool(np.isclose(area(mesh), boxes * AREA) and np.isclose(volume(mesh), boxes * VOLUME))


def rows(table, prefix="") -> str:
    return "".join(prefix + " ".join(map(str, row)) + "\n" for row in table)


def obj(faces: Any = FACES) -> bytes:
    return (rows(VERTICES, "v ") + rows(np.asarray(faces) + 1, "f ")).encode()


def off(faces: Any = FACES, header="OFF") -> bytes:
    counted = [(len(face), *face) for face in faces]
    text = f"{header}\n{len(VERTICES)} {len(faces)} 0\n" + rows(VERTICES) + rows(counted)
    return text.encode()


def stl_binary(header=b"", faces: Any = FACES) -> bytes:
    records = b"".join(struct.pack("<12fH", 0, 0, 0, *VERTICES[face].ravel(), 0) for face in faces)
    return header.ljust(80) + struct.pack("<I", len(faces)) + records


def stl_ascii(name="box") -> bytes:
    facets = "".join(
        "facet normal 0 0 0\n  outer loop\n"
        + rows(VERTICES[face], "    vertex ")
        + "  endloop\nendfacet\n"
        for face in FACES
    )
    return f"solid {name}\n{facets}endsolid {name}\n".encode("latin-1")


def ply_header(kind: str, faces: int, count="uchar", item="int") -> bytes:
    return (
        f"ply\nformat {kind} 1.0\ncomment a box\nelement vertex {len(VERTICES)}\n"
        "property float x\nproperty float y\nproperty float z\n"
        f"element face {faces}\nproperty list {count} {item} vertex_indices\nend_header\n"
    ).encode()


def ply_ascii(faces: Any = FACES) -> bytes:
    counted = [(len(face), *face) for face in faces]
    return ply_header("ascii", len(faces)) + (rows(VERTICES) + rows(counted)).encode()


def ply_binary(faces: Any = FACES, order="<") -> bytes:
    kind = {"<": "binary_little_endian", ">": "binary_big_endian"}[order]
    lists = b"".join(struct.pack(f"{order}B{len(face)}i", len(face), *face) for face in faces)
    return ply_header(kind, len(faces)) + VERTICES.astype(order + "f4").tobytes() + lists


def gltf_document(indices=None, mode=4) -> tuple[dict, bytes]:
    indices = FACES.ravel() if indices is None else np.asarray(indices)
    positions = VERTICES.astype("<f4").tobytes()
    data = positions + indices.astype("<u2").tobytes()
    document = {
        "asset": {"version": "2.0"},
        "scene": 0,
        "scenes": [{"nodes": [0]}],
        "nodes": [{"mesh": 0}],
        "meshes": [{"primitives": [{"attributes": {"POSITION": 0}, "indices": 1, "mode": mode}]}],
        "accessors": [
            {"bufferView": 0, "componentType": 5126, "count": len(VERTICES), "type": "VEC3"},
            {"bufferView": 1, "componentType": 5123, "count": len(indices), "type": "SCALAR"},
        ],
        "bufferViews": [
            {"buffer": 0, "byteLength": len(positions)},
            {"buffer": 0, "byteOffset": len(positions), "byteLength": 2 * len(indices)},
        ],
        "buffers": [{"byteLength": len(data)}],
    }
    return document, data


def pack_glb(document: dict, data: bytes) -> bytes:
    return pack_glb_text(json.dumps(document).encode(), data)


def pack_glb_text(text: bytes, data: bytes) -> bytes:
    text += b" " * (-len(text) % 4)
    data += b"\0" * (-len(data) % 4)
    chunks = struct.pack("<I4s", len(text), b"JSON") + text
    chunks += struct.pack("<I4s", len(data), b"BIN\0") + data
    return struct.pack("<4s2I", b"glTF", 2, 12 + len(chunks)) + chunks


def pack_gltf(document: dict, data: bytes) -> bytes:
    document["buffers"] = [{"byteLength": len(data), "uri": data_uri(data)}]
    return json.dumps(document).encode()


def add_array(
    document: dict, data: bytes, values: Any, shape: str, component: int, **more: Any
) -> tuple[int, bytes]:
    """The number of a new accessor of a document, and the data with its numbers behind.

    component: the number of a type in glTF; more: further entries of the accessor.
    """
    types = {5120: "i1", 5121: "u1", 5122: "<i2", 5123: "<u2", 5125: "<u4", 5126: "<f4"}
    values = np.asarray(values).astype(types[component])
    data += bytes(-len(data) % 4)
    view = {"buffer": 0, "byteOffset": len(data), "byteLength": values.nbytes}
    document["bufferViews"].append(view)
    entry = {"bufferView": len(document["bufferViews"]) - 1, "componentType": component}
    document["accessors"].append(entry | {"count": len(values), "type": shape} | more)
    data += values.tobytes()
    document["buffers"][0]["byteLength"] = len(data)
    return len(document["accessors"]) - 1, data


def gltf1_document(buffer="box") -> tuple[dict, bytes]:
    """The box in the words of glTF 1.0."""
    document, data = gltf_document()
    accessors, views = document["accessors"], document["bufferViews"]
    return {
        "asset": {"version": "1.0"},
        "scene": "all",
        "scenes": {"all": {"nodes": ["root"]}},
        "nodes": {"root": {"children": ["leaf"]}, "leaf": {"meshes": ["box"]}},
        "meshes": {
            "box": {
                "primitives": [{"attributes": {"POSITION": "points"}, "indices": "corners"}],
            }
        },
        "accessors": {
            "points": accessors[0] | {"bufferView": "first", "byteOffset": 0, "byteStride": 12},
            "corners": accessors[1] | {"bufferView": "second", "byteOffset": 0, "byteStride": 0},
        },
        "bufferViews": {
            "first": views[0] | {"buffer": buffer, "byteOffset": 0},
            "second": views[1] | {"buffer": buffer},
        },
        "buffers": {buffer: {"byteLength": len(data), "type": "arraybuffer"}},
    }, data


def gltf1() -> bytes:
    document, data = gltf1_document()
    document["buffers"]["box"]["uri"] = data_uri(data)
    return json.dumps(document).encode()


def glb1() -> bytes:
    document, data = gltf1_document("binary_glTF")
    document["buffers"]["binary_glTF"]["uri"] = "data:,"
    text = json.dumps(document).encode()
    size = 20 + len(text) + len(data)
    return struct.pack("<4s4I", b"glTF", 1, size, len(text), 0) + text + data


def gltf_in_pieces(uri="box.bin") -> tuple[bytes, bytes]:
    """A .gltf whose buffer lies in another file, and that file."""
    document, data = gltf_document()
    document["buffers"][0]["uri"] = uri
    return json.dumps(document).encode(), data


def data_uri(data: bytes) -> str:
    return "data:application/octet-stream;base64," + base64.b64encode(data).decode()


def glb() -> bytes:
    return pack_glb(*gltf_document())


def gltf() -> bytes:
    return pack_gltf(*gltf_document())


def mesh_xml(faces: Any = FACES, identifier="1") -> str:
    vertices = "".join(f'<vertex x="{x}" y="{y}" z="{z}"/>' for x, y, z in VERTICES)
    triangles = "".join(f'<triangle v1="{a}" v2="{b}" v3="{c}"/>' for a, b, c in faces)
    return (
        f'<object id="{identifier}"><mesh><vertices>{vertices}</vertices>'
        f"<triangles>{triangles}</triangles></mesh></object>"
    )


def model_xml(objects: str, items: str = '<item objectid="1"/>', unit="millimeter") -> str:
    return (
        f'<?xml version="1.0"?><model unit="{unit}" '
        'xmlns="http://schemas.microsoft.com/3dmanufacturing/core/2015/02" '
        'xmlns:p="http://schemas.microsoft.com/3dmanufacturing/production/2015/06">'
        f"<resources>{objects}</resources><build>{items}</build></model>"
    )


def threemf(parts: Mapping[str, str | bytes] | None = None) -> bytes:
    return archive(parts or {"3D/3dmodel.model": model_xml(mesh_xml())})


def amf(vertices: Any = VERTICES, faces: Any = FACES, more="", volume="") -> bytes:
    """AMF: one object, then what else the document holds; `volume`: of its one volume."""

    def tags(names, rows) -> str:
        return "".join(f"<{name}>{value}</{name}>" for name, value in zip(names, rows, strict=True))

    points = "".join(
        f"<vertex><coordinates>{tags('xyz', row)}</coordinates></vertex>" for row in vertices
    )
    triangles = "".join(f"<triangle>{tags(('v1', 'v2', 'v3'), row)}</triangle>" for row in faces)
    return (
        '<?xml version="1.0" encoding="utf-8"?><amf unit="inch"><object id="1"><mesh>'
        f"<vertices>{points}</vertices><volume>{volume}{triangles}</volume></mesh></object>{more}"
        "</amf>"
    ).encode()


def archive(files: Mapping[str, str | bytes], method: int = zipfile.ZIP_DEFLATED) -> bytes:
    stream = BytesIO()
    with zipfile.ZipFile(stream, "w", method) as package:
        for name, content in files.items():
            package.writestr(name, content)
    return stream.getvalue()


# Every spelling of the box: the declared extension and the bytes.
SPELLINGS: dict[str, tuple[str, bytes]] = {
    "obj": ("obj", obj()),
    "obj of quads": ("obj", obj(QUADS)),
    "off": ("off", off()),
    "off of quads": ("off", off(QUADS)),
    "stl binary": ("stl", stl_binary()),
    "stl ascii": ("stl", stl_ascii()),
    "ply ascii": ("ply", ply_ascii()),
    "ply ascii of quads": ("ply", ply_ascii(QUADS)),
    "ply little endian": ("ply", ply_binary()),
    "ply big endian": ("ply", ply_binary(order=">")),
    "ply binary of quads": ("ply", ply_binary(QUADS)),
    "glb": ("glb", glb()),
    "gltf": ("gltf", gltf()),
    "glb 1.0": ("glb", glb1()),
    "gltf 1.0": ("gltf", gltf1()),
    "3mf": ("3mf", threemf()),
    "amf": ("amf", amf()),
    "amf in a zip": ("amf", archive({"box.amf": amf()})),
    "zip": ("zip", archive({"read me.txt": "a box", "parts/box.stl": stl_binary()})),
}
