"""On ordinary files, written by trimesh, every format gives the triangles that trimesh gives."""

from io import BytesIO

import numpy as np
import pytest

from meshconv3d.model.loading import load_mesh

trimesh = pytest.importorskip("trimesh")


@pytest.mark.parametrize(
    ("file_type", "extension"),
    [
        ("obj", "obj"),
        ("off", "off"),
        ("stl", "stl"),
        ("stl_ascii", "stl"),
        ("ply", "ply"),
        ("glb", "glb"),
        ("3mf", "3mf"),
    ],
)
def test_the_same_triangles_as_trimesh(file_type, extension):
    knot = trimesh.creation.torus(2.0, 0.7)
    knot.visual.vertex_colors = np.tile([255, 0, 0, 255], (len(knot.vertices), 1))
    scene = trimesh.Scene([knot, knot.copy().apply_translation([9, 0, 0])])
    data = (scene if extension in ("glb", "3mf") else knot).export(file_type=file_type)
    data = data.encode() if isinstance(data, str) else data
    theirs = trimesh.load_mesh(BytesIO(data), file_type=extension, process=False)
    ours = load_mesh(data, extension)
    assert np.allclose(_sorted(ours.vertices[ours.faces]), _sorted(theirs.triangles), atol=1e-6)


def _sorted(triangles):
    """Triangles (F x 3 x 3) in an order of their own, rounded so that it is stable."""
    flat = np.round(triangles.reshape(len(triangles), 9), 4)
    return triangles[np.lexsort(flat.T)]
