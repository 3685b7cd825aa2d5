"""Subdivision meets the face budget from below, and the surface stays."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from meshconv3d.model.preparation import surface_area
from meshconv3d.model.preparation.cleaning import clean
from meshconv3d.model.preparation.subdivision import subdivide
from meshconv3d.model.topology.halfedges import find_twins
from tests.meshes import cube
from tests.surfaces import MANIFOLD, triangles


@given(triangles(kinds=MANIFOLD), st.integers(0, 120))
@settings(max_examples=60)
def test_subdividing_splits_faces_where_they_are(surface, room):
    vertices, faces, counts, *_ = clean(surface.mesh())
    budget = len(faces) + room
    new_vertices, new_faces = subdivide(vertices, faces, budget)
    assert budget - 1 <= len(new_faces) <= budget
    assert (new_vertices[: len(vertices)] == vertices).all()
    area = surface_area(vertices, faces)
    assert surface_area(new_vertices, new_faces) == pytest.approx(area)
    _, border, nonmanifold = find_twins(new_faces, len(new_vertices))
    assert nonmanifold == 0
    assert (border == 0) == counts["watertight"]
    # V - E + F stays, and so does every directed edge's being there once.
    runs = {(f[s], f[(s + 1) % 3]) for f in new_faces.tolist() for s in range(3)}
    assert len(runs) == 3 * len(new_faces)
    euler = [
        len(v) - (3 * len(f) + find_twins(f, len(v))[1]) // 2 + len(f)
        for v, f in ((vertices, faces), (new_vertices, new_faces))
    ]
    assert euler[0] == euler[1]


@pytest.mark.parametrize("budget", [499, 500])
def test_a_cube_is_subdivided_with_its_longest_edges_first(budget):
    mesh = cube()
    vertices, faces = subdivide(mesh.vertices, mesh.faces, budget)
    assert len(faces) in (budget - 1, budget)
    assert surface_area(vertices, faces) == pytest.approx(6)
    assert np.abs(vertices - 0.5).max(axis=1) == pytest.approx(0.5)
    corners = vertices[faces]
    longest = np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=2).max(axis=1)
    assert longest.max() <= 2.01 * longest.min()
