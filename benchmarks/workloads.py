"""The meshes that are measured, as values and as files."""

import io

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


def as_file(mesh: Mesh, extension: str) -> bytes:
    """The bytes of a binary file: stl, ply or glb."""
    file = io.BytesIO()
    trimesh.Trimesh(mesh.vertices, mesh.faces, process=False).export(file, file_type=extension)
    return file.getvalue()
