"""Subdivision meets the face budget from below, and the surface stays."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from meshconv3d.model.preparation import surface_area
from meshconv3d.model.preparation.cleaning import clean
from meshconv3d.model.preparation.subdivision import flip_flat_edges, subdivide
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


def sheet(seed: int) -> tuple[np.ndarray, np.ndarray]:
    """A flat sheet of irregular quadrilaterals, tilted in space, each cut along either diagonal."""
    side = 6
    x, y = np.meshgrid(np.arange(side), np.arange(side), indexing="ij")
    points = np.stack([x, y], axis=-1) + np.random.default_rng(0).uniform(0, 0.3, (side, side, 2))
    axes = np.linalg.qr(np.random.default_rng(1).normal(size=(3, 3)))[0][:2]
    corner = (side * x + y)[:-1, :-1].reshape(-1)
    a, b, c, d = corner, corner + side, corner + side + 1, corner + 1
    one, other = np.stack([a, b, c, a, c, d], 1), np.stack([a, b, d, b, c, d], 1)
    cut = np.random.default_rng(seed).random(len(corner)) < 0.5
    return points.reshape(-1, 2) @ axes, np.where(cut[:, None], one, other).reshape(-1, 3)


@pytest.mark.parametrize("seed", range(3))
def test_a_flat_part_is_divided_alike_however_it_was_cut(seed):
    vertices, faces = subdivide(*sheet(9), 500)
    again, same = subdivide(*sheet(seed), 500)
    assert (sheet(seed)[1] != sheet(9)[1]).any()
    assert (again == vertices).all()
    assert (same == faces).all()


def test_faces_that_are_flat_together_become_delaunay():
    """But not across a sharp edge, nor where that would make an edge of four faces."""
    vertices = np.array([(0, 0, 0), (10, 0, 0), (5, 1, 0), (5, -1, 0)], float)
    faces, flipped = np.array([(0, 1, 2), (1, 0, 3)], np.int32), {(0, 3, 2), (1, 2, 3)}

    def diagonals(vertices, faces):
        faces = faces.copy()
        flip_flat_edges(vertices, faces, find_twins(faces, len(vertices))[0])
        return {tuple(np.roll(face, -face.argmin()).tolist()) for face in faces}

    assert diagonals(vertices, faces) == flipped
    bent = vertices + np.array([(0, 0, 0), (0, 0, 0), (0, 0, 0.1), (0, 0, 0.1)])
    assert diagonals(bent, faces) == set(map(tuple, faces.tolist())) - {(1, 0, 3)} | {(0, 3, 1)}
    both_sides = np.concatenate([faces, [(0, 2, 3), (1, 3, 2)]]).astype(np.int32)
    assert diagonals(vertices, both_sides) >= {(0, 1, 2), (0, 3, 1)}
