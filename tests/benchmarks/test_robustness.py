"""Changes of meshes, and the mean corruption error."""

import numpy as np
import pytest

from benchmarks.corruptions import FILES, SHAPES
from benchmarks.robustness import UNCHANGED, mean_corruption_error
from meshconv3d.model.preparation import prepare, surface_area
from tests.meshes import torus


@pytest.mark.parametrize("title", [*FILES, *SHAPES])
def test_a_changed_mesh_can_be_prepared_and_has_about_its_surface(title):
    mesh, _ = prepare(torus(), 500)
    changed = (FILES | SHAPES)[title](mesh, np.random.default_rng(5))
    prepared, _ = prepare(changed, 500)
    assert 200 <= len(prepared.faces) <= 500
    areas = [surface_area(each.vertices, each.faces) for each in (changed, mesh)]
    area = areas[0] / areas[1]
    match title:
        case "every face twice":
            assert area == pytest.approx(2)
        case "20 % of the faces in five holes":
            assert len(changed.faces) == pytest.approx(400, abs=5)
        case "scanned from one side":
            assert 0.2 < area < 0.8
        case "noise, 2 % of the diagonal" | "stretched by 30 %" | "a floor plate":
            assert 1.05 < area < 2.5
        case _:
            assert area == pytest.approx(1, abs=0.15)


@pytest.mark.parametrize(
    ("title", "faces"), [("a speck", 4), ("ten specks", 40), ("a floor plate", 12)]
)
def test_what_is_put_beside_a_mesh_leaves_it_as_it_is(title, faces):
    mesh = torus()
    changed = FILES[title](mesh, np.random.default_rng(5))
    assert (changed.vertices[:250] == mesh.vertices).all()
    assert (changed.faces[:500] == mesh.faces).all()
    assert changed.faces[500:].min() == 250
    assert len(changed.faces) == 500 + faces


def test_soup_has_vertices_of_its_own_for_every_face():
    soup = FILES["triangle soup"](torus(), np.random.default_rng(5))
    assert len(soup.vertices) == 1500
    assert prepare(soup, 500)[1].vertices_merged == 1250


def test_the_mean_corruption_error_leaves_out_what_is_unchanged():
    baseline = {UNCHANGED: 0.0, "one": 0.2, "two": 0.6}
    assert mean_corruption_error(baseline, baseline) == 1
    table = {UNCHANGED: 1.0, "one": 0.8, "two": 1.0}
    assert mean_corruption_error(table, baseline) == pytest.approx(0.2 / 1.2)
