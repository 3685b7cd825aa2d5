"""More triangles on flat sides: exactly as many as asked for, on the same surface, Delaunay."""

from itertools import pairwise

import numpy as np
import pytest

from benchmarks.cubes.meshing import refine
from meshconv3d.model.preparation import surface_area
from meshconv3d.model.topology.halfedges import find_twins
from tests.meshes import cube

SIDES = [(axis, side) for axis in range(3) for side in (0.0, 1.0)]


def opposite_angles(vertices, faces) -> np.ndarray:
    """The angle across each half-edge, H."""
    corners = vertices[faces]
    u = corners - np.roll(corners, -2, 1)
    v = np.roll(corners, -1, 1) - np.roll(corners, -2, 1)
    cosine = (u * v).sum(-1) / np.linalg.norm(u, axis=-1) / np.linalg.norm(v, axis=-1)
    return np.arccos(np.clip(cosine, -1, 1)).reshape(-1)


@pytest.mark.parametrize("count", [12, 14, 100, 500])
def test_a_cube_gets_as_many_faces_as_asked_for(count):
    """Squares, whose corners lie on circles, included."""
    box = cube()
    vertices, faces = refine(box.vertices, box.faces, count, SIDES)
    assert len(faces) == count
    twin, border, nonmanifold = find_twins(faces, len(vertices))
    assert border == nonmanifold == 0
    assert np.array_equal(faces.reshape(-1)[twin], np.roll(faces, -1, axis=1).reshape(-1))
    assert np.isin(vertices, (0, 1)).any(axis=1).all()
    assert surface_area(vertices, faces) == pytest.approx(6)
    a, b, c = vertices[faces].transpose(1, 0, 2)
    assert np.einsum("ij,ij->", a, np.cross(b, c)) / 6 == pytest.approx(1)


def test_triangles_on_a_side_are_delaunay():
    """Also those of a fan, from a corner of a side to points along another of its edges."""
    along = np.linspace(0, 1, 9)[1:-1]
    fan = np.array([[0, y, 1] for y in along])
    box = cube()
    numbers = np.arange(8, 8 + len(fan))
    # Corner 4x + 2y + z: the fan lies on the edge from 1 to 3, shared by the sides z = 1 and x = 0.
    others = [f for f in box.faces.tolist() if not {1, 3} <= set(f)]
    chain = [1, *numbers.tolist(), 3]
    faces = others + [
        triangle for f in box.faces.tolist() if {1, 3} <= set(f) for triangle in split(f, chain)
    ]
    vertices = np.concatenate([box.vertices, fan])
    vertices, faces = refine(vertices, np.array(faces, np.int32), 60, SIDES)
    twin, border, _ = find_twins(faces, len(vertices))
    assert border == 0
    side = np.array([[(vertices[f][:, a] == c).all() for a, c in SIDES] for f in faces]).argmax(1)
    angles = opposite_angles(vertices, faces)
    inner = side[np.arange(len(twin)) // 3] == side[twin // 3]
    assert inner.sum() > 60
    assert (angles + angles[twin])[inner].max() <= np.pi + 1e-6


def split(face: list[int], chain: list[int]) -> list[list[int]]:
    """A triangle over the whole chain, or over it reversed, cut at every point of it."""
    place = next(s for s in range(3) if {face[s], face[(s + 1) % 3]} == {chain[0], chain[-1]})
    far = face[(place + 2) % 3]
    points = chain if face[place] == chain[0] else chain[::-1]
    return [[one, two, far] for one, two in pairwise(points)]


def test_a_mesh_with_more_faces_keeps_their_number():
    box = cube()
    vertices, faces = refine(box.vertices, box.faces, 100, SIDES)
    assert len(refine(vertices, faces, 50, SIDES)[1]) == 100
