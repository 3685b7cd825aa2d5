"""An explanation as a binary glTF 2.0 file.

No two faces share a vertex, so that each keeps its colour to its edges. The material is rough and
no metal, which without a surrounding to mirror would be black, and is seen from both sides. There
are no normals: without them a viewer must take those of the faces. Node extras carry the legend.
"""

import json
import struct

import numpy as np

from meshconv3d.service.evidence.colours import linear_colours
from meshconv3d.service.evidence.explanation import Explanation
from meshconv3d.service.evidence.records import legend

FLOAT, UNSIGNED_SHORT = 5126, 5123
ARRAY_BUFFER = 34962


def to_glb(file: str | None, explanation: Explanation) -> bytes:
    """The coloured mesh, placed as in its file."""
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
    document = {
        "asset": {"version": "2.0", "generator": "meshconv3d"},
        "scene": 0,
        "scenes": [{"nodes": [0]}],
        "nodes": [
            {
                "mesh": 0,
                "name": title,
                "translation": origin.tolist(),
                "extras": legend(file, explanation).model_dump(by_alias=True),
            }
        ],
        "meshes": [
            {
                "name": title,
                "primitives": [{"attributes": {"POSITION": 0, "COLOR_0": 1}, "material": 0}],
            }
        ],
        "materials": [
            {
                "name": "evidence",
                "doubleSided": True,
                "pbrMetallicRoughness": {"metallicFactor": 0, "roughnessFactor": 1},
            }
        ],
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
        "bufferViews": [
            {
                "buffer": 0,
                "byteOffset": 0,
                "byteLength": positions.nbytes,
                "target": ARRAY_BUFFER,
            },
            {
                "buffer": 0,
                "byteOffset": positions.nbytes,
                "byteLength": colours.nbytes,
                "target": ARRAY_BUFFER,
            },
        ],
        "buffers": [{"byteLength": positions.nbytes + colours.nbytes}],
    }
    text = json.dumps(document).encode()
    text += b" " * (-len(text) % 4)
    binary = positions.tobytes() + colours.tobytes()  # 12 and 8 bytes each: a multiple of 4
    chunks = struct.pack("<I4s", len(text), b"JSON") + text
    chunks += struct.pack("<I4s", len(binary), b"BIN\0") + binary
    return struct.pack("<4sII", b"glTF", 2, 12 + len(chunks)) + chunks
