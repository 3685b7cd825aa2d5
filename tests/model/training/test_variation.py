"""Copies for training: other meshes of the same thing, which preparation takes."""

import numpy as np
import pytest

from meshconv3d.model.preparation import prepare, surface_area
from meshconv3d.model.topology.halfedges import find_twins
from meshconv3d.model.training import variation
from tests.meshes import icosphere, sheet, torus


@pytest.fixture
def rng() -> np.random.Generator:
    return np.random.default_rng(5)


def area(mesh) -> float:
    return surface_area(mesh.vertices, mesh.faces)


@pytest.mark.parametrize("count", [100, 250, 1000, 4000])
def test_the_face_count_is_met_on_the_same_surface(count):
    mesh = variation.with_faces(torus(), count)
    assert len(mesh.faces) == count
    assert area(mesh) == pytest.approx(area(torus()), rel=0.1)


def test_other_triangles_lie_on_the_same_surface(rng):
    mesh = variation.retriangulated(torus(), rng)
    assert len(mesh.faces) == 4 * 500
    assert area(mesh) == pytest.approx(area(torus()), rel=0.05)


@pytest.mark.parametrize("times", [1, 2])
def test_smoothing_multiplies_the_faces_and_rounds(times):
    mesh = variation.smoothed(icosphere(1), times)
    assert len(mesh.faces) == 80 * 4**times
    assert mesh.vertices.max() < icosphere(1).vertices.max()


def test_noise_is_a_share_of_the_diagonal(rng):
    mesh = torus(100, 50)
    moved = variation.noisy(mesh, 0.01, rng).vertices - mesh.vertices
    assert moved.std() == pytest.approx(0.01 * variation.diagonal(mesh), rel=0.05)


@pytest.mark.parametrize("share", [0.05, 0.1])
def test_a_cut_is_one_hole_of_its_share(share, rng):
    mesh = variation.cut(torus(), share, rng)
    assert len(mesh.faces) == round((1 - share) * 500)
    _, border, _ = find_twins(mesh.faces, len(mesh.vertices))
    assert 0 < border < 3 * share * 500
    assert prepare(mesh, 500)[1].components == 1


@pytest.mark.parametrize("generator", [None, np.random.default_rng(5)], ids=["flattest", "random"])
@pytest.mark.parametrize("mesh", [torus(), sheet(15, 16)], ids=["closed", "open"])
def test_flipped_edges_keep_the_surface_a_manifold(mesh, generator):
    flipped = variation.flipped(mesh, 0.2, generator)
    twin, border, nonmanifold = find_twins(flipped.faces, len(mesh.vertices))
    assert border == find_twins(mesh.faces, len(mesh.vertices))[1]
    assert nonmanifold == 0
    # Neighbours run along their edge in opposite directions.
    h = np.flatnonzero(twin >= 0)
    ends = np.roll(flipped.faces, -1, axis=1).reshape(-1)
    assert (flipped.faces.reshape(-1)[h] == ends[twin[h]]).all()
    edges = len(mesh.faces) * 3 // 2
    changed = (flipped.faces != mesh.faces).any(axis=1).sum()
    assert changed == pytest.approx(2 * 0.2 * edges, rel=0.1)
    assert area(flipped) == pytest.approx(area(mesh), rel=0.02)


@pytest.mark.parametrize("mesh", [torus(), sheet(15, 16)], ids=["closed", "open"])
def test_random_copies_can_be_prepared_and_differ(mesh, rng):
    prepared, _ = prepare(mesh, 500)
    copies = [prepare(variation.vary(prepared, rng), 500)[0] for _ in range(30)]
    assert all(450 <= len(copy.faces) <= 500 for copy in copies)
    shapes = {copy.vertices.tobytes() for copy in copies}
    assert len(shapes) >= 20


def test_copies_repeat_with_their_generator():
    mesh, _ = prepare(torus(), 500)
    one, two = (
        [variation.vary(mesh, rng).vertices for _ in range(10)]
        for rng in (np.random.default_rng(1), np.random.default_rng(1))
    )
    assert all(np.array_equal(a, b) for a, b in zip(one, two, strict=True))
