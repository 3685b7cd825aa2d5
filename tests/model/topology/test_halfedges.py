"""Twins and adjacency against dictionaries of edges, patches against a walk over lists."""

from collections import defaultdict

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from meshconv3d.model.topology.halfedges import (
    edge_lengths,
    find_twins,
    grow_patches,
    sort_adjacency,
)
from meshconv3d.model.topology.surface import Surface
from tests.meshes import cube, torus
from tests.surfaces import MANIFOLD, triangles


def half_edges_by_edge(faces) -> dict[frozenset[int], list[int]]:
    """Half-edges over every edge, ascending; faces that name a vertex twice have none."""
    edges = defaultdict(list)
    for f, face in enumerate(faces.tolist()):
        if len(set(face)) == 3:
            for s in range(3):
                edges[frozenset((face[s], face[(s + 1) % 3]))].append(3 * f + s)
    return edges


def twins_by_dictionary(faces, pair_nonmanifold=True) -> tuple[list[int], int, int]:
    """The stated pairing: twos are twins; of more, the next that runs the other way, or none."""
    twin = [-1] * faces.size
    edges = half_edges_by_edge(faces)
    for run in edges.values():
        pairs = []
        if len(run) == 2:
            pairs = [run]
        elif len(run) > 2 and pair_nonmanifold:
            start, end = faces.reshape(-1), np.roll(faces, -1, axis=1).reshape(-1)
            up = [h for h in run if start[h] < end[h]]
            down = [h for h in run if start[h] > end[h]]
            pairs = zip(up, down, strict=False)
        for one, other in pairs:
            twin[one], twin[other] = other, one
    sizes = [len(run) for run in edges.values()]
    return twin, sizes.count(1), sum(size > 2 for size in sizes)


@given(triangles(), st.booleans())
def test_twins_are_those_of_an_edge_dictionary(surface, pair_nonmanifold):
    twin, border, nonmanifold = find_twins(surface.faces, surface.vertex_count, pair_nonmanifold)
    expected = twins_by_dictionary(surface.faces, pair_nonmanifold)
    assert (twin.tolist(), border, nonmanifold) == expected


@given(st.lists(st.tuples(*[st.integers(0, 5)] * 3), min_size=1, max_size=30))
def test_twins_of_any_triples_whatever_they_repeat(triples):
    faces = np.array(triples, np.int32)
    twin, border, nonmanifold = find_twins(faces, 6)
    assert (twin.tolist(), border, nonmanifold) == twins_by_dictionary(faces)
    paired = np.flatnonzero(twin >= 0)
    assert (twin[twin[paired]] == paired).all()
    assert (twin[paired] // 3 != paired // 3).all()


@given(triangles(kinds=("closed",)))
def test_a_closed_surface_has_no_border(surface):
    twin, border, nonmanifold = find_twins(surface.faces, surface.vertex_count)
    assert (twin >= 0).all()
    assert (border, nonmanifold) == (0, 0)


def test_three_faces_on_one_edge_pair_by_direction():
    # Over the edge 0-1: face 0 runs up, face 1 up, face 2 down.
    faces = np.array([[0, 1, 2], [0, 1, 3], [1, 0, 4]], np.int32)
    twin, border, nonmanifold = find_twins(faces, 5)
    assert (twin[0], twin[6], twin[3]) == (6, 0, -1)
    assert (border, nonmanifold) == (6, 1)
    assert (find_twins(faces, 5, False)[0] == -1).all()


@given(triangles())
def test_lengths_are_those_of_the_edges(surface):
    mesh = surface.mesh()
    corners = mesh.vertices[mesh.faces]
    expected = np.linalg.norm(np.roll(corners, -1, axis=1) - corners, axis=2).reshape(-1)
    assert edge_lengths(mesh.vertices, mesh.faces) == pytest.approx(expected)


@given(triangles(), st.booleans(), st.integers(0, 2**32 - 1))
def test_neighbours_are_sorted_by_shared_edge_shortest_first(surface, ties, seed):
    twin = find_twins(surface.faces, surface.vertex_count)[0]
    rng = np.random.default_rng(seed)
    lengths = rng.integers(1, 4, len(twin)).astype(float) if ties else rng.random(len(twin))
    expected = []
    for f in range(len(surface.faces)):
        sides = [h for h in range(3 * f, 3 * f + 3) if twin[h] >= 0]
        sides.sort(key=lambda h: lengths[h] + lengths[twin[h]])
        expected.append([twin[h] // 3 + 1 for h in sides] + [0] * (3 - len(sides)))
    assert sort_adjacency(twin, lengths).tolist() == expected


@given(triangles(kinds=MANIFOLD))
def test_on_a_manifold_face_neighbours_are_mutual_and_share_two_corners(surface):
    mesh = surface.mesh()
    twin = find_twins(surface.faces, surface.vertex_count)[0]
    adjacency = sort_adjacency(twin, edge_lengths(mesh.vertices, mesh.faces))
    for f, row in enumerate(adjacency.tolist()):
        for neighbour in filter(None, row):
            assert f + 1 in adjacency[neighbour - 1]
            assert len({*surface.faces[f]} & {*surface.faces[neighbour - 1]}) == 2


def walk(adjacency, face, size) -> list[int]:
    patch = [face + 1]
    for visited in patch:  # grows while it is walked
        patch += [n for n in adjacency[visited - 1] if n and n not in patch]
    patch = patch[:size]
    return patch + [0] * (size - len(patch))


def adjacency_of(surface: Surface) -> np.ndarray:
    return sort_adjacency(surface.twin, surface.lengths)


@given(triangles(), st.integers(1, 40))
def test_patches_are_breadth_first_walks(surface, size):
    adjacency = adjacency_of(Surface.of(surface.mesh()))
    expected = [walk(adjacency.tolist(), f, size) for f in range(len(adjacency))]
    assert grow_patches(adjacency, size).tolist() == expected


def test_a_patch_of_one_is_the_face():
    assert Surface.of(torus()).patches(1).tolist() == [[f + 1] for f in range(500)]


def test_a_patch_of_four_is_the_face_and_its_neighbours():
    surface = Surface.of(torus())
    assert (surface.patches(4)[:, 1:] == adjacency_of(surface)).all()


@pytest.mark.parametrize("size", [1, 5, 12, 30])
def test_a_small_component_pads_with_the_null_face(size):
    patches = Surface.of(cube()).patches(size)
    for f, patch in enumerate(patches):
        faces = patch[patch > 0]
        assert patch[0] == f + 1
        assert len({*faces.tolist()}) == len(faces) == min(size, 12)
        assert (patch[len(faces) :] == 0).all()
