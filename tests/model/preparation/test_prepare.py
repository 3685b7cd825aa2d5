"""Preparation from end to end: budget, unit sphere, report, and what must not matter."""

import numpy as np
import pytest

from meshconv3d.model.errors import UnusableMesh
from meshconv3d.model.mesh import Mesh
from meshconv3d.model.preparation import into_unit_sphere, prepare, surface_area
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

BUDGET = 500
KINDS = {
    "fits": torus(),
    "large": icosphere(3),
    "small": cube(),
    "open": sheet(20, 20),
    "one face": Mesh(np.eye(3), [[0, 1, 2]]),
    "one-sided": moebius(),
    "soup": soup(torus(30, 12)),
    "components": together(torus(), cube(), sheet(3, 3)),
}


@pytest.mark.parametrize("mesh", KINDS.values(), ids=KINDS.keys())
def test_every_kind_meets_the_budget_in_the_unit_sphere(mesh):
    prepared, report = prepare(mesh, BUDGET)
    assert len(prepared.faces) in (BUDGET - 1, BUDGET)
    assert report.faces_used == len(prepared.faces)
    assert report.faces_in == len(mesh.faces)
    assert np.linalg.norm(prepared.vertices, axis=1).max() == pytest.approx(1)
    a, b, c = prepared.vertices[prepared.faces].transpose(1, 0, 2)
    areas = np.linalg.norm(np.cross(b - a, c - a), axis=1)
    assert np.average((a + b + c) / 3, axis=0, weights=areas) == pytest.approx(0, abs=1e-7)
    assert len(np.unique(prepared.faces)) == len(prepared.vertices)
    _, border, nonmanifold = find_twins(prepared.faces, len(prepared.vertices))
    assert nonmanifold == 0
    assert report.watertight == (border == 0)


def test_a_mesh_that_fits_only_moves():
    mesh = torus()
    prepared, report = prepare(mesh, BUDGET)
    triangles = placed_triangles(prepared.vertices, prepared.faces)
    expected = placed_triangles(into_unit_sphere(mesh.vertices, mesh.faces), mesh.faces)
    assert triangles == pytest.approx(expected, abs=3e-6)
    assert (report.resampled, report.area_kept) == ("none", 1)


@pytest.mark.parametrize("budget", [500, 501])
def test_one_face_below_the_budget_fits_too(budget):
    assert prepare(torus(), budget)[1].resampled == "none"


def test_a_cube_is_subdivided_without_changing_its_shape():
    prepared, report = prepare(cube(), BUDGET)
    assert (report.resampled, report.faces_in, report.vertices_in) == ("subdivided", 12, 8)
    assert surface_area(prepared.vertices, prepared.faces) == pytest.approx(6 / 0.75)
    assert np.abs(prepared.vertices).max(axis=1) == pytest.approx(0.75**-0.5 / 2)
    assert report.area_kept == 1
    assert report.watertight


def test_a_sphere_is_decimated_and_stays_a_sphere():
    prepared, report = prepare(icosphere(4), BUDGET)
    assert (report.resampled, report.faces_in, report.faces_used) == ("decimated", 5120, BUDGET)
    assert np.linalg.norm(prepared.vertices, axis=1) == pytest.approx(1, abs=0.03)
    assert report.area_kept == pytest.approx(1, abs=0.03)
    assert (report.components, report.components_lost) == (1, 0)


@pytest.mark.parametrize("mesh", [torus(), torus(40, 20), torus(12, 8), sheet(20, 20)])
@pytest.mark.parametrize("extent", [1e-3, 1.0, 1e5])
@pytest.mark.parametrize("offset", [0, 1e3])
def test_size_and_place_do_not_matter(mesh, extent, offset):
    moved = mesh.moved((mesh.vertices + np.array([1, -2, 3]) * offset) * extent)
    one, report = prepare(mesh, BUDGET)
    two, other_report = prepare(moved, BUDGET)
    assert (one.faces == two.faces).all()
    assert two.vertices == pytest.approx(one.vertices, abs=1e-8)
    assert report == other_report


def test_hundreds_of_small_components_leave_the_largest():
    rng = np.random.default_rng(0)
    crumbs = [cube().moved(cube().vertices * 0.3 + rng.uniform(0, 20, 3)) for _ in range(100)]
    crumbs += [cube().moved(cube().vertices * 0.1 + rng.uniform(0, 20, 3)) for _ in range(100)]
    prepared, report = prepare(together(*crumbs), BUDGET)
    assert report.components > 150
    assert report.components_lost >= 0
    assert report.faces_used == len(prepared.faces) < report.faces_in


def test_the_report_counts_what_was_found():
    mesh = soup(cube())
    wrong = [mesh.faces[0][::-1], *mesh.faces[1:], [0, 1, 1], mesh.faces[5]]
    _, report = prepare(Mesh(mesh.vertices, wrong), BUDGET)
    assert report.faces_in == 14
    assert (report.vertices_in, report.vertices_merged) == (36, 28)
    assert (report.degenerate_dropped, report.duplicates_dropped) == (1, 1)
    assert (report.flipped, report.components, report.border_edges) == (1, 1, 0)
    assert (report.nonmanifold_edges, report.vertices_split) == (0, 0)
    assert report.watertight


def test_a_mesh_without_area_is_refused():
    with pytest.raises(UnusableMesh, match="none of the 1 faces") as caught:
        prepare(Mesh([(0, 0, 0), (1, 0, 0), (2, 0, 0)], [[0, 1, 2]]), BUDGET)
    assert caught.value.fault == "no-area"


def test_a_shape_that_simplification_destroys_is_refused():
    # A torus crumpled by noise as large as itself: most of its area is in the folds.
    rng = np.random.default_rng(1)
    fine = torus(120, 60)
    foliage = fine.moved(fine.vertices + rng.normal(0, 1, fine.vertices.shape))
    with pytest.raises(UnusableMesh, match=f"simplifying {len(fine.faces)} faces") as caught:
        prepare(foliage, BUDGET)
    assert caught.value.fault == "lost-in-simplification"


def test_preparing_twice_changes_nothing():
    once, _ = prepare(torus(40, 20), BUDGET)
    twice, report = prepare(once, BUDGET)
    triangles = placed_triangles(once.vertices, once.faces)
    assert placed_triangles(twice.vertices, twice.faces) == pytest.approx(triangles, abs=3e-6)
    assert (report.resampled, report.flipped, report.vertices_split) == ("none", 0, 0)
