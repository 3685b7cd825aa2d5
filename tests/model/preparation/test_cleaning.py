"""Cleaning leaves an oriented manifold, and counts what it did."""

from collections import Counter

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from meshconv3d.model.errors import UnusableMesh
from meshconv3d.model.mesh import Mesh
from meshconv3d.model.preparation.cleaning import GRID_SHIFT, GRID_STEPS, clean
from meshconv3d.model.topology.halfedges import find_twins
from tests.meshes import (
    cube,
    icosphere,
    moebius,
    placed_triangles,
    sheet,
    soup,
    together,
    torus,
)
from tests.surfaces import triangles


def check_oriented_manifold(faces: np.ndarray) -> None:
    # Every edge has one face on each side at most, and the two run along it in opposite ways.
    runs = Counter((face[s], face[(s + 1) % 3]) for face in faces.tolist() for s in range(3))
    assert max(runs.values()) == 1
    # The faces around every vertex are one fan: linked through the edges that they share there.
    links: dict[int, dict[int, list[int]]] = {}
    for face in faces.tolist():
        for s in range(3):
            corner, a, b = face[s], face[(s + 1) % 3], face[(s + 2) % 3]
            link = links.setdefault(corner, {})
            link.setdefault(a, []).append(b)
            link.setdefault(b, []).append(a)
    for link in links.values():
        reached, stack = set(), [next(iter(link))]
        while stack:
            if (v := stack.pop()) not in reached:
                reached.add(v)
                stack += link[v]
        assert len(reached) == len(link)


def positions(vertices: np.ndarray, faces: np.ndarray) -> list:
    """The triangles as points of the welding grid, whatever their order, winding and numbers."""
    steps = np.rint(vertices * GRID_STEPS + GRID_SHIFT).astype(int)
    return sorted(sorted(map(tuple, steps[face].tolist())) for face in faces)


def signed_volume(vertices: np.ndarray, faces: np.ndarray) -> float:
    a, b, c = (vertices - vertices.mean(axis=0))[faces].transpose(1, 0, 2)
    return float(np.einsum("ij,ij->", a, np.cross(b, c)) / 6)


@given(triangles())
@settings(max_examples=200)
def test_any_triangles_become_an_oriented_manifold_and_stay_where_they_are(surface):
    mesh = surface.mesh()
    vertices, faces, counts, twin, component, *_ = clean(mesh)
    check_oriented_manifold(faces)
    assert (twin == find_twins(faces, len(vertices))[0]).all()
    low, high = mesh.vertices.min(axis=0), mesh.vertices.max(axis=0)
    found, placed = (
        positions(vertices, faces),
        positions((mesh.vertices - low) / (high - low).max(), mesh.faces),
    )
    assert counts["components"] == len(np.unique(component))
    if counts["walls_dropped"]:
        assert len(found) == len(placed) - counts["walls_dropped"]
        assert all(triangle in placed for triangle in found)
    else:
        assert found == placed
        assert len(vertices) == surface.vertex_count + counts["vertices_split"]


@pytest.mark.parametrize("mesh", [cube(), torus(), sheet(), icosphere(2)])
def test_a_clean_mesh_is_left_alone(mesh):
    vertices, faces, counts, *_ = clean(mesh)
    low, high = mesh.vertices.min(axis=0), mesh.vertices.max(axis=0)
    expected = placed_triangles((mesh.vertices - low) / (high - low).max(), mesh.faces)
    assert placed_triangles(vertices, faces) == pytest.approx(expected, abs=1e-6)
    assert len(vertices) == len(mesh.vertices)
    zero = ("vertices_merged", "degenerate_dropped", "duplicates_dropped", "nonmanifold_edges")
    assert [counts[name] for name in (*zero, "vertices_split", "flipped")] == [0] * 6
    assert counts["vertices_in"] == len(mesh.vertices)
    assert counts["components"] == 1


def test_triangle_soup_is_welded():
    vertices, _, counts, *_ = clean(soup(icosphere(2)))
    assert len(vertices) == 162
    assert counts["vertices_in"] == 960
    assert counts["vertices_merged"] == 960 - 162
    assert counts["watertight"]
    assert (counts["components"], counts["border_edges"]) == (1, 0)


def test_nearly_equal_vertices_are_welded_and_distant_ones_are_not():
    apart = soup(cube())
    noise = np.random.default_rng(0).uniform(-1, 1, apart.vertices.shape)
    near = apart.moved(apart.vertices * 0.9 + 0.0500001 + 1e-9 * noise)
    assert clean(near)[2]["watertight"]
    far = apart.moved(apart.vertices + 1e-3 * noise)
    assert clean(far)[2]["vertices_merged"] == 0


def test_unused_vertices_do_not_count():
    mesh = cube()
    extra = Mesh(np.concatenate([[[9, 9, 9]], mesh.vertices, [[7, 7, 7]]]), mesh.faces + 1)
    vertices, faces, counts, *_ = clean(extra)
    assert (len(vertices), counts["vertices_in"], counts["vertices_merged"]) == (8, 8, 0)
    assert positions(vertices, faces) == positions(mesh.vertices, mesh.faces)


def test_degenerate_and_duplicate_faces_are_dropped_and_counted():
    mesh = cube()
    middle = [*mesh.vertices, (mesh.vertices[0] + mesh.vertices[1]) / 2]
    degenerate = [[0, 0, 1], [3, 5, 3], [0, 8, 1]]
    duplicate = [mesh.faces[3], np.roll(mesh.faces[3], 1), mesh.faces[7][::-1]]
    vertices, faces, counts, *_ = clean(Mesh(middle, [*mesh.faces, *degenerate, *duplicate]))
    assert (counts["degenerate_dropped"], counts["duplicates_dropped"]) == (3, 3)
    assert positions(vertices, faces) == positions(mesh.vertices, mesh.faces)
    assert counts["watertight"]


def test_a_height_that_is_lost_in_rounding_is_none():
    mesh = cube()
    sliver = Mesh([*mesh.vertices, (0.5, -1e-11, 0)], [*mesh.faces, [0, 4, 8]])
    thin = Mesh([*mesh.vertices, (0.5, -1e-5, 0)], [*mesh.faces, [0, 4, 8]])
    assert clean(sliver)[2]["degenerate_dropped"] == 1
    assert clean(thin)[2]["degenerate_dropped"] == 0


def test_nothing_but_lines_and_points_has_no_area():
    line = Mesh([(0, 0, 0), (1, 1, 1), (2, 2, 2)], [[0, 1, 2], [0, 0, 1]])
    with pytest.raises(UnusableMesh, match="none of the 2 faces") as caught:
        clean(line)
    assert caught.value.fault == "no-area"


def test_surfaces_that_touch_in_a_corner_come_apart_there():
    one = cube()
    bow_tie = together(one, one.moved(-one.vertices))
    vertices, faces, counts, *_ = clean(bow_tie)
    check_oriented_manifold(faces)
    assert (counts["vertices_merged"], counts["vertices_split"]) == (1, 1)
    assert (counts["components"], counts["nonmanifold_edges"]) == (2, 0)
    assert (len(vertices), counts["watertight"]) == (16, True)


def test_surfaces_that_touch_in_an_edge_come_apart_there():
    one = cube()
    _, faces, counts, *_ = clean(together(one, one.moved(one.vertices * [-1, -1, 1])))
    check_oriented_manifold(faces)
    assert counts["nonmanifold_edges"] == 1
    assert counts["vertices_merged"] == 2
    assert len(faces) == 24


def test_a_fin_on_a_closed_surface_is_an_edge_of_three():
    mesh = cube()
    fin = Mesh([*mesh.vertices, (-1, -1, 0.5)], [*mesh.faces, [0, 1, 8]])
    _, faces, counts, *_ = clean(fin)
    check_oriented_manifold(faces)
    assert counts["nonmanifold_edges"] == 1
    assert not counts["watertight"]


@pytest.mark.parametrize("mesh", [cube(), torus(), icosphere(2)])
def test_an_inverted_closed_mesh_is_turned_outward(mesh):
    assert signed_volume(mesh.vertices, mesh.faces) > 0
    vertices, faces, counts, *_ = clean(Mesh(mesh.vertices, mesh.faces[:, ::-1]))
    assert signed_volume(vertices, faces) > 0
    assert counts["flipped"] == len(mesh.faces)


@given(st.integers(0, 2**32 - 1))
@settings(max_examples=20)
def test_mixed_winding_is_made_outward_and_counted(seed):
    mesh = torus(8, 6)
    wrong = np.random.default_rng(seed).random(len(mesh.faces)) < 0.5
    mixed = Mesh(mesh.vertices, np.where(wrong[:, None], mesh.faces[:, ::-1], mesh.faces))
    vertices, faces, counts, *_ = clean(mixed)
    check_oriented_manifold(faces)
    assert counts["flipped"] == wrong.sum()
    assert signed_volume(vertices, faces) > 0


def test_an_open_half_sphere_looks_outward_whichever_way_it_was_wound():
    ball = icosphere(3)
    half = ball.faces[(ball.vertices[ball.faces][:, :, 2] > -0.1).all(axis=1)]
    for wound in (half, half[:, ::-1]):
        vertices, faces, counts, *_ = clean(Mesh(ball.vertices, wound))
        a, b, c = vertices[faces].transpose(1, 0, 2)
        normals = np.cross(b - a, c - a)
        centre = np.array([0.5, 0.5, 0])
        assert (np.sum(normals * ((a + b + c) / 3 - centre), axis=1) > 0).all()
        assert not counts["watertight"]


def test_a_flat_sheet_keeps_the_side_that_most_of_it_shows():
    plain = sheet(6, 6)
    flat = plain.vertices * [1, 1, 0]
    few = np.arange(len(plain.faces)) < 10
    mixed = np.where(few[:, None], plain.faces[:, ::-1], plain.faces)
    vertices, faces, counts, *_ = clean(Mesh(flat, mixed))
    a, b, c = vertices[faces].transpose(1, 0, 2)
    assert (np.cross(b - a, c - a)[:, 2] > 0).all()
    assert counts["flipped"] == 10


def test_components_are_turned_each_by_itself():
    one, two = icosphere(1), cube()
    two = Mesh(two.vertices + 5, two.faces[:, ::-1])
    vertices, faces, counts, *_ = clean(together(one, two))
    assert counts["flipped"] == 12
    assert counts["components"] == 2
    assert signed_volume(vertices, faces[:80]) > 0
    assert signed_volume(vertices, faces[80:]) > 0


def test_a_one_sided_strip_is_cut_once_across():
    strip = moebius()
    vertices, faces, counts, *_ = clean(strip)
    check_oriented_manifold(faces)
    assert (len(faces), len(vertices)) == (48, 50)
    assert counts["components"] == 1
    assert not counts["watertight"]
