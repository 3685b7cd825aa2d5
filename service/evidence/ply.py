"""An explanation as a binary PLY file: corners with a colour each, faces with their numbers."""

import json

import numpy as np

from meshconv3d.service.evidence.colours import srgb_colours
from meshconv3d.service.evidence.explanation import Explanation
from meshconv3d.service.evidence.records import legend

CORNER = np.dtype([("place", "<f8", 3), ("colour", "u1", 3)])
FACE = np.dtype(
    [("count", "u1"), ("corners", "<i4", 3), ("contribution", "<f8"), ("density", "<f8")]
)
HEADER = """\
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


def to_ply(file: str | None, explanation: Explanation) -> bytes:
    """The coloured mesh; no two faces share a vertex. The comment is the legend, in JSON."""
    mesh, densities = explanation.mesh, explanation.densities
    count = len(mesh.faces)
    corners = np.empty(3 * count, CORNER)
    corners["place"] = mesh.vertices[mesh.faces].reshape(-1, 3)
    corners["colour"] = np.repeat(srgb_colours(densities / (explanation.limit or 1.0)), 3, axis=0)
    faces = np.empty(count, FACE)
    faces["count"] = 3
    faces["corners"] = np.arange(3 * count).reshape(-1, 3)
    faces["contribution"] = explanation.contributions
    faces["density"] = densities
    head = HEADER.format(
        legend=json.dumps(legend(file, explanation).model_dump(by_alias=True)),
        corners=3 * count,
        faces=count,
    )
    return head.encode() + corners.tobytes() + faces.tobytes()
