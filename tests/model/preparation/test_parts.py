"""Which parts of a mesh are kept."""

import numpy as np
import pytest

from meshconv3d.model.errors import UnusableMesh
from meshconv3d.model.mesh import Mesh
from meshconv3d.model.preparation import prepare, surface_area
from tests.meshes import cube, torus

BUDGET = 500


def placed(mesh: Mesh, copies: int, size: float, seed: int = 0) -> Mesh:
    """Copies of a mesh of some size, at random places above the others, far apart."""
    random = np.random.default_rng(seed)
    places = np.stack([3.0 * np.arange(copies), *random.random((2, copies))], 1)
    vertices = (places[:, None] + size * mesh.vertices).reshape(-1, 3)
    first = len(mesh.vertices) * np.arange(copies)
    return Mesh(vertices, (first[:, None, None] + mesh.faces).reshape(-1, 3))


def joined(*meshes: Mesh) -> Mesh:
    first = np.cumsum([0, *(len(mesh.vertices) for mesh in meshes[:-1])])
    return Mesh(
        np.vstack([mesh.vertices for mesh in meshes]),
        np.vstack([mesh.faces + start for mesh, start in zip(meshes, first, strict=True)]),
    )


@pytest.mark.parametrize("specks", [1, 10, 100])
def test_dust_is_dropped_and_counted(specks: int) -> None:
    ring = torus()
    prepared, report = prepare(joined(ring, placed(cube(), specks, 0.001)), BUDGET)
    alone, _ = prepare(ring, BUDGET)
    assert (report.components, report.components_lost) == (specks + 1, specks)
    # The shape is prepared as without dust, where that does not move the unit box.
    assert len(prepared.faces) == len(alone.faces)


def test_small_parts_that_are_much_of_the_surface_stay() -> None:
    _, report = prepare(placed(cube(), 40, 1.0), BUDGET)
    assert (report.components, report.components_lost) == (40, 0)
    assert report.within_budget


def test_a_mesh_of_too_many_parts_is_refused() -> None:
    with pytest.raises(UnusableMesh, match="many loose parts") as refusal:
        prepare(placed(cube(), 600, 1.0), BUDGET)
    assert refusal.value.fault == "lost-in-simplification"


def test_of_more_scraps_than_fit_those_with_most_area_stand_for_all() -> None:
    leaf = Mesh([(0, 0, 0), (1, 0, 0), (0, 1, 0)], [[0, 1, 2]])
    small, large = placed(leaf, 10_000, 0.5), placed(leaf, 400, 1.0)
    _, report = prepare(joined(small, large), BUDGET)
    assert (report.faces_used, report.components, report.within_budget) == (BUDGET, 10_400, True)
    area = 400 * 0.5 + 100 * 0.125
    assert report.area_kept == pytest.approx(area / (400 * 0.5 + 10_000 * 0.125), abs=1e-3)
    assert "of 10400 parts were dropped" in report.note


def test_which_parts_stay_does_not_depend_on_the_order_of_faces() -> None:
    mesh = joined(torus(), placed(cube(), 30, 0.002), placed(cube(), 3, 0.5, seed=1))
    shuffled = Mesh(
        mesh.vertices, mesh.faces[np.random.default_rng(2).permutation(len(mesh.faces))]
    )
    (one, first), (other, second) = prepare(mesh, BUDGET), prepare(shuffled, BUDGET)
    assert first == second
    assert np.array_equal(one.vertices, other.vertices)
    assert np.array_equal(one.faces, other.faces)


def cells(side: int) -> Mesh:
    """The six faces of each cell of a block of side^3 cubes: those between two are there twice."""
    steps = np.array([(i, j, k) for i in range(side) for j in range(side) for k in range(side)])
    vertices = (steps[:, None] + cube().vertices).reshape(-1, 3)
    first = len(cube().vertices) * np.arange(len(steps))
    return Mesh(vertices, (first[:, None, None] + cube().faces).reshape(-1, 3))


def test_the_shape_of_a_volume_mesh_is_its_shell() -> None:
    prepared, report = prepare(cells(4), BUDGET)
    assert report.walls_dropped > 0
    assert report.watertight
    assert report.within_budget
    # A cube in the unit sphere has sides of 2 / sqrt(3).
    assert surface_area(prepared.vertices, prepared.faces) == pytest.approx(8, rel=1e-6)


def test_components_lost_is_never_negative() -> None:
    for mesh in (torus(), cube(), placed(torus(), 3, 1.0)):
        assert prepare(mesh, 100)[1].components_lost >= 0
