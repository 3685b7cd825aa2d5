"""A mesh that exists is sound; anything else is a fault with its name and count."""

import pickle

import numpy as np
import pytest

from meshconv3d.model.errors import UnusableMesh
from meshconv3d.model.mesh import Mesh
from tests.meshes import cube

CORNERS = np.eye(3)
NAN, INF = float("nan"), float("inf")


@pytest.mark.parametrize(
    ("vertices", "faces", "fault", "says"),
    [
        (np.zeros((4, 2)), [[0, 1, 2]], "bad-vertices", r"\(4, 2\)"),
        (np.zeros(9), [[0, 1, 2]], "bad-vertices", r"\(9,\)"),
        (CORNERS, np.zeros((0, 3), int), "no-faces", "3 points"),
        (np.zeros((0, 3)), [], "no-faces", "0 points"),
        (CORNERS, [[0, 1, 2, 0]], "bad-faces", r"\(1, 4\)"),
        (CORNERS, [0, 1, 2], "bad-faces", r"\(3,\)"),
        (CORNERS, [[0.0, 1.0, 2.0]], "bad-faces", "float64"),
        (CORNERS, [[0, 1, 3], [0, 1, -1]], "index-out-of-range", "^2 of 6 .* 0 to 2"),
        ([(0, 0, NAN), (1, 0, 0), (0, -INF, 0)], [[0, 1, 2]], "non-finite-vertices", "^2 of 3"),
        ([(-1e308, 0, 0), (1e308, 0, 0), (0, 1, 0)], [[0, 1, 2]], "extent-overflow", "1e.308"),
        ([(5, 5, 5)] * 3, [[0, 1, 2]], "zero-extent", "all 3 vertices"),
    ],
)
def test_unsound_arrays_are_refused_with_their_fault(vertices, faces, fault, says):
    with pytest.raises(UnusableMesh, match=says) as caught:
        Mesh(vertices, faces)
    assert caught.value.fault == fault


def test_what_no_face_uses_is_not_judged():
    mesh = Mesh(np.vstack([CORNERS, [(NAN, 0, 0), (1e308, 0, 0), (-1e308, 0, 0)]]), [[0, 1, 2]])
    assert len(mesh.vertices) == 6


def test_a_mesh_cannot_change_and_shares_nothing_with_its_source():
    vertices, faces = np.eye(3), np.array([[0, 1, 2]])
    mesh = Mesh(vertices, faces)
    vertices[:] = 7
    faces[:] = 0
    assert (mesh.vertices == np.eye(3)).all()
    assert mesh.faces.tolist() == [[0, 1, 2]]
    for array in (mesh.vertices, mesh.faces):
        with pytest.raises(ValueError, match="read-only"):
            array[0] = 1


def test_moving_keeps_the_triangles_and_checks_the_vertices():
    mesh = cube()
    moved = mesh.moved(mesh.vertices + 1)
    assert (moved.faces == mesh.faces).all()
    assert moved.vertices.min() == 1
    with pytest.raises(UnusableMesh):
        mesh.moved(mesh.vertices * NAN)


def test_errors_survive_a_process_boundary():
    error = pickle.loads(pickle.dumps(UnusableMesh("zero-extent", "all in one point")))
    assert (type(error), error.fault, str(error)) == (
        UnusableMesh,
        "zero-extent",
        "all in one point",
    )
