"""Shape descriptors: free of position, size and numbering, and right where the truth is known."""

import numpy as np
import pytest

from benchmarks.baseline_methods.descriptors import Descriptors
from benchmarks.baseline_methods.distributions import shape_distributions
from benchmarks.baseline_methods.measures import shape_measures
from meshconv3d.model.mesh import Mesh
from meshconv3d.model.training.augmentation import random_rotation
from tests.meshes import cube, icosphere, sheet, together, torus

# No two moments alike: of equal ones even the smallest box may lie one way or another.
BENT = torus().moved(torus().vertices * (1, 0.7, 1.4) + 0.2 * torus().vertices[:, [1, 2, 0]] ** 2)
MESHES = {"torus": BENT, "sheet": sheet(), "parts": together(BENT, cube().moved(cube().vertices))}


def distributions_of(mesh: Mesh) -> dict[str, np.ndarray]:
    return shape_distributions(mesh, 32768, np.random.default_rng(0))


@pytest.mark.parametrize("name", MESHES)
def test_position_size_and_vertex_numbers_change_nothing(name: str) -> None:
    mesh = MESHES[name]
    rng = np.random.default_rng(2)
    order = rng.permutation(len(mesh.vertices))
    placed = 0.01 * mesh.vertices @ random_rotation(rng).T + 0.05
    moved = Mesh(placed[np.argsort(order)], order[mesh.faces])
    before, after = Descriptors().describe(mesh), Descriptors().describe(moved)
    # A pair on the edge of two bins may change sides.
    assert after == pytest.approx(before, rel=1e-5, abs=1e-4)


@pytest.mark.parametrize("name", MESHES)
def test_the_order_of_faces_changes_samples_and_nothing_else(name: str) -> None:
    mesh = MESHES[name]
    rng = np.random.default_rng(3)
    turns = (np.arange(3) + rng.integers(0, 3, (len(mesh.faces), 1))) % 3
    faces = np.take_along_axis(mesh.faces, turns, axis=1)[rng.permutation(len(mesh.faces))]
    other = Mesh(mesh.vertices, faces)
    for group, values in shape_measures(mesh).items():
        assert shape_measures(other)[group] == pytest.approx(values, abs=1e-6), group
    for group, values in distributions_of(mesh).items():
        assert distributions_of(other)[group] == pytest.approx(values, abs=0.05), group


def test_points_of_a_ball_are_one_radius_from_its_centre() -> None:
    found = distributions_of(icosphere(4))
    assert found["D1"] == pytest.approx(1, abs=0.01)
    # The chord of a sphere has the distribution d^2 / 4.
    assert found["D2"] == pytest.approx(2 * np.sqrt((np.arange(16) + 0.5) / 16), abs=0.02)
    assert found["normal to centroid"].sum() == pytest.approx(1)
    assert found["normal to centroid"].reshape(8, 6)[:, -1].sum() == pytest.approx(1)


def test_measures_of_a_cube() -> None:
    found = shape_measures(cube())
    scale = 6**1.5
    sides, reach, hull_of_box, of_hull, hull_round, round_, area = np.split(
        found["hull and box"], [2, 3, 4, 5, 6, 7]
    )
    assert sides == pytest.approx([1, 1])
    assert reach == pytest.approx(1 / np.sqrt(6))
    assert [*hull_of_box, *of_hull, *area] == pytest.approx([1, 1, 1])
    assert [*hull_round, *round_] == pytest.approx([1 / scale, 1 / scale])
    assert found["parts"] == pytest.approx([1, 1, 0, 0, 0, 0, 0])
    assert found["topology"] == pytest.approx([2, 0])
    assert found["moments"][:5] == pytest.approx([1, 1, 1 / 3, 1 / 3, 1 / 3])
    edges, diagonals = 12.0, 6 * np.sqrt(2)
    flat, *_, convex, length = found["edges"]
    assert length == pytest.approx((edges + diagonals) / np.sqrt(6))
    assert flat == pytest.approx(diagonals / (edges + diagonals))
    assert convex >= edges / (edges + diagonals)
    assert found["angle defects"] == pytest.approx(np.pi / 2)


def test_measures_of_two_balls_and_of_an_open_sheet() -> None:
    ball = icosphere(2)
    pair = shape_measures(together(ball, ball.moved(2 * ball.vertices + 9)))
    assert pair["parts"][:3] == pytest.approx([2, 0.8, 0.2])
    assert pair["topology"] == pytest.approx([4, 0])
    euler, border = shape_measures(sheet())["topology"]
    assert euler == 1
    assert border > 3


@pytest.mark.filterwarnings("ignore:invalid value:RuntimeWarning:trimesh")
def test_a_flat_mesh_has_no_volume_and_is_described() -> None:
    described = Descriptors().describe(sheet().moved(sheet().vertices * (1, 1, 0)))
    assert np.isfinite(described).all()
