"""The meshes that are measured, as values and as files."""

from typing import Any

import numpy as np
import trimesh

from meshconv3d.model.loading import load_mesh
from meshconv3d.model.mesh import Mesh
from meshconv3d.model.samples import sample_paths

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


# Every form in which a mesh can be written here, and how trimesh does; the last word of its name is
# the extension.
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
}


def as_file(mesh: Mesh, form: str) -> bytes:
    """The bytes of a file in one of FORMS."""
    options = {"file_type": form.split()[-1], **FORMS[form]}
    shape = trimesh.Trimesh(mesh.vertices, mesh.faces, process=False)
    content = shape.export(**options)
    if isinstance(content, dict):  # a glTF file, with the pieces that it has not in itself: none
        content = content["model.gltf"]
    return content.encode() if isinstance(content, str) else content
