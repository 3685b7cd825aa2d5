"""Explanations as mesh files: binary glTF 2.0 and binary PLY.

No two faces share a vertex, so that each keeps its colour to its edges.
"""

import json
import struct

import numpy as np

from meshconv3d.service.attribution.colours import linear_colours, srgb_colours
from meshconv3d.service.attribution.explanation import Explanation
from meshconv3d.service.attribution.legend import legend

FLOAT, UNSIGNED_SHORT, ARRAY_BUFFER = 5126, 5123, 34962  # codes of glTF

PLY_CORNER = np.dtype([("place", "<f8", 3), ("colour", "u1", 3)])
PLY_FACE = np.dtype(
    [("count", "u1"), ("corners", "<i4", 3), ("contribution", "<f8"), ("density", "<f8")]
)
PLY_HEADER = """\
ply
format binary_little_endian 1.0
comment {legend}
element vertex {corners}
property double x
property double y
property double z
property uchar red
property uchar green
property uchar blue
element face {faces}
property list uchar int vertex_indices
property double contribution
property double density
end_header
"""


def to_glb(file: str | None, explanation: Explanation) -> bytes:
    """The coloured mesh, placed as in its file, with the legend in the node's extras.

    The material is rough, not metallic (which without surroundings to mirror is black), and seen
    from both sides. There are no normals: a viewer then takes those of the faces.
    """
    mesh = explanation.mesh
    corners = mesh.vertices[mesh.faces].reshape(-1, 3)
    # The file's origin may be so far away that single precision could not tell the corners apart.
    origin = (corners.min(axis=0) + corners.max(axis=0)) / 2
    positions = (corners - origin).astype("<f4")
    colours = np.ones((len(mesh.faces), 4))
    colours[:, :3] = linear_colours(explanation.densities / (explanation.limit or 1.0))
    # Two bytes a channel: linear light in one has steps that show in the dark.
    colours = np.repeat(np.round(65535 * colours).astype("<u2"), 3, axis=0)
    title = f"evidence for {explanation.label}"
    primitive = {"attributes": {"POSITION": 0, "COLOR_0": 1}, "material": 0}
    surface = {"metallicFactor": 0, "roughnessFactor": 1}
    extras = legend(file, explanation).model_dump(by_alias=True)
    document = {
        "asset": {"version": "2.0", "generator": "meshconv3d"},
        "scene": 0,
        "scenes": [{"nodes": [0]}],
        "nodes": [{"mesh": 0, "name": title, "translation": origin.tolist(), "extras": extras}],
        "meshes": [{"name": title, "primitives": [primitive]}],
        "materials": [{"name": "evidence", "doubleSided": True, "pbrMetallicRoughness": surface}],
        "accessors": [
            {
                "bufferView": 0,
                "componentType": FLOAT,
                "count": len(positions),
                "type": "VEC3",
                "min": positions.min(axis=0).tolist(),
                "max": positions.max(axis=0).tolist(),
            },
            {
                "bufferView": 1,
                "componentType": UNSIGNED_SHORT,
                "normalized": True,
                "count": len(colours),
                "type": "VEC4",
            },
        ],
        "bufferViews": [_view(0, positions.nbytes), _view(positions.nbytes, colours.nbytes)],
        "buffers": [{"byteLength": positions.nbytes + colours.nbytes}],
    }
    text = json.dumps(document).encode()
    text += b" " * (-len(text) % 4)
    binary = positions.tobytes() + colours.tobytes()  # 12 and 8 bytes each: a multiple of 4
    chunks = struct.pack("<I4s", len(text), b"JSON") + text
    chunks += struct.pack("<I4s", len(binary), b"BIN\0") + binary
    return struct.pack("<4sII", b"glTF", 2, 12 + len(chunks)) + chunks


def _view(start: int, size: int) -> dict[str, int]:
    return {"buffer": 0, "byteOffset": start, "byteLength": size, "target": ARRAY_BUFFER}


def to_ply(file: str | None, explanation: Explanation) -> bytes:
    """The coloured mesh, with each face's contribution and density; the comment is the legend, in
    JSON."""
    mesh, densities = explanation.mesh, explanation.densities
    count = len(mesh.faces)
    corners = np.empty(3 * count, PLY_CORNER)
    corners["place"] = mesh.vertices[mesh.faces].reshape(-1, 3)
    corners["colour"] = np.repeat(srgb_colours(densities / (explanation.limit or 1.0)), 3, axis=0)
    faces = np.empty(count, PLY_FACE)
    faces["count"] = 3
    faces["corners"] = np.arange(3 * count).reshape(-1, 3)
    faces["contribution"] = explanation.contributions
    faces["density"] = densities
    comment = json.dumps(legend(file, explanation).model_dump(by_alias=True))
    head = PLY_HEADER.format(legend=comment, corners=3 * count, faces=count)
    return head.encode() + corners.tobytes() + faces.tobytes()
