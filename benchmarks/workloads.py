"""The meshes that are measured, as values and as files."""

from typing import Any

import numpy as np
import trimesh

from meshconv3d.model.loading import load_mesh
from meshconv3d.model.mesh import Mesh
from tests.articulated import sample_paths

SAMPLE = "ants"  # a sample of exactly 500 faces


def torus(faces: int) -> Mesh:
    """A closed torus of this many faces, or a few less, irregular enough to have no exact ties."""
    sides = round((faces / 5) ** 0.5)
    shape = trimesh.creation.torus(1.0, 0.4, faces // (2 * sides), sides)
    noise = np.random.default_rng(0).normal(0, 0.1 / sides, shape.vertices.shape)
    return Mesh(shape.vertices + noise, shape.faces)


def sample() -> Mesh:
    """The sample mesh, which fits the face budget of the paper as it is."""
    return load_mesh(sample_paths()[SAMPLE])


# Every form in which a mesh can be written here, and what trimesh needs to do it; the last word of
# its name is the extension.
FORMS: dict[str, dict[str, Any]] = {
    "obj": {},
    "off": {},
    "text stl": {"file_type": "stl_ascii"},
    "stl": {},
    "text ply": {"encoding": "ascii"},
    "ply": {},
    "gltf": {"embed_buffers": True},
    "glb": {},
    "3mf": {},
    "amf": {},
    "dae": {},
    "usda": {},
}


def as_file(mesh: Mesh, form: str) -> bytes:
    """The bytes of a file in one of FORMS."""
    if form in WRITERS:
        return WRITERS[form](mesh).encode()
    options = {"file_type": form.split()[-1], **FORMS[form]}
    shape = trimesh.Trimesh(mesh.vertices, mesh.faces, process=False)
    content = shape.export(**options)
    if isinstance(content, dict):  # a glTF file, with the pieces that it has not in itself: none
        content = content["model.gltf"]
    return content.encode() if isinstance(content, str) else content


def amf(mesh: Mesh, digits: int = 8) -> str:
    """The mesh as AMF, which trimesh does not write. digits: of each coordinate."""
    points = "".join(
        f"<vertex><coordinates><x>{x:.{digits}g}</x><y>{y:.{digits}g}</y><z>{z:.{digits}g}</z>"
        "</coordinates></vertex>\n"
        for x, y, z in mesh.vertices.tolist()
    )
    triangles = "".join(
        f"<triangle><v1>{a}</v1><v2>{b}</v2><v3>{c}</v3></triangle>\n"
        for a, b, c in mesh.faces.tolist()
    )
    return (
        '<?xml version="1.0" encoding="UTF-8"?>\n<amf unit="millimeter"><object id="0"><mesh>\n'
        f"<vertices>\n{points}</vertices>\n<volume>\n{triangles}</volume>\n"
        "</mesh></object></amf>\n"
    )


def _usda(mesh: Mesh) -> str:
    points = ", ".join(f"({x:.8g}, {y:.8g}, {z:.8g})" for x, y, z in mesh.vertices.tolist())
    corners = ", ".join(map(str, mesh.faces.reshape(-1).tolist()))
    counts = ", ".join(["3"] * len(mesh.faces))
    return (
        f'#usda 1.0\ndef Mesh "mesh"\n{{\nint[] faceVertexCounts = [{counts}]\n'
        f"int[] faceVertexIndices = [{corners}]\npoint3f[] points = [{points}]\n}}\n"
    )


# Forms that trimesh does not write.
WRITERS = {"amf": amf, "usda": _usda}
