"""Simplification meets the face budget from above, and the shape stays."""

import numpy as np
import pytest

from meshconv3d.model.mesh import Mesh
from meshconv3d.model.preparation import prepare, prepare_placed, surface_area
from meshconv3d.model.preparation.cleaning import clean
from meshconv3d.model.preparation.simplification import MOST_FACES, ROOM, coarsen, decimate
from meshconv3d.model.topology.halfedges import find_twins
from tests.meshes import icosphere, sheet, together, torus

BUDGET = 500


def fine() -> Mesh:
    return torus(160, 80)


@pytest.mark.parametrize(
    "mesh",
    [fine(), sheet(120, 120), together(fine(), torus(30, 20, radius=0.2, tube=0.1))],
    ids=["closed", "open", "parts"],
)
def test_a_coarse_mesh_is_sound_and_covers_the_same_surface(mesh: Mesh) -> None:
    vertices, faces, _ = clean(mesh)
    assert len(faces) > MOST_FACES
    coarse, coarse_faces = coarsen(vertices, faces, BUDGET)
    assert len(coarse_faces) == pytest.approx(ROOM * BUDGET, rel=0.02)
    _, border, nonmanifold = find_twins(coarse_faces, len(coarse))
    assert nonmanifold == 0
    assert (border > 0) == (find_twins(faces, len(vertices))[1] > 0)
    assert surface_area(coarse, coarse_faces) == pytest.approx(
        surface_area(vertices, faces), rel=0.05
    )
    assert coarse.min(axis=0) == pytest.approx(vertices.min(axis=0), abs=0.01)
    assert coarse.max(axis=0) == pytest.approx(vertices.max(axis=0), abs=0.01)


def test_a_mesh_with_fewer_faces_stays_as_it_is() -> None:
    vertices, faces, _ = clean(torus(100, 100))
    assert coarsen(vertices, faces, BUDGET) == (vertices, faces)


def test_a_shape_that_is_all_folds_is_left_to_the_careful_simplification() -> None:
    mesh = fine()
    noise = np.random.default_rng(1).normal(0, 0.5, mesh.vertices.shape)
    vertices, faces, _ = clean(mesh.moved(mesh.vertices + noise))
    assert coarsen(vertices, faces, BUDGET) == (vertices, faces)


def test_what_is_prepared_lies_where_the_file_has_it() -> None:
    mesh = fine().moved(fine().vertices * 30 + [5, -7, 100])
    prepared, report, placement = prepare_placed(mesh, BUDGET)
    assert report.faces_used == BUDGET
    assert report.area_kept == pytest.approx(1, abs=0.02)
    placed = placement.into_file(prepared.vertices)
    assert placed.min(axis=0) == pytest.approx(mesh.vertices.min(axis=0), abs=0.6)
    assert placed.max(axis=0) == pytest.approx(mesh.vertices.max(axis=0), abs=0.6)


def test_the_order_of_the_file_changes_nothing() -> None:
    mesh = fine()
    order = np.random.default_rng(0).permutation(len(mesh.faces))
    one, _ = prepare(mesh, BUDGET)
    other, _ = prepare(Mesh(mesh.vertices, mesh.faces[order]), BUDGET)
    assert (one.vertices == other.vertices).all()
    assert (one.faces == other.faces).all()


@pytest.mark.parametrize("mesh", [icosphere(3), torus(40, 20), together(icosphere(3), torus())])
@pytest.mark.parametrize("budget", [500, 300])
def test_closed_meshes_are_decimated_to_the_budget_exactly(mesh, budget):
    vertices, faces = decimate(mesh.vertices, mesh.faces, budget)
    _, border, nonmanifold = find_twins(faces, len(vertices))
    assert len(faces) == budget
    assert (border, nonmanifold) == (0, 0)
    area = surface_area(mesh.vertices, mesh.faces)
    assert surface_area(vertices, faces) == pytest.approx(area, rel=0.05)


def test_an_open_sheet_keeps_its_border():
    mesh = sheet(30, 30)
    vertices, faces = decimate(mesh.vertices, mesh.faces, 500)
    _, border, nonmanifold = find_twins(faces, len(vertices))
    assert len(faces) in (499, 500)
    assert nonmanifold == 0
    assert border > 10
    extent = np.ptp(vertices, axis=0)[:2]
    assert extent == pytest.approx(np.ptp(mesh.vertices, axis=0)[:2], rel=0.02)
