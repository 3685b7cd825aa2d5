"""Laplace-Beltrami eigenvalues against those known by formula."""

import numpy as np
import pytest

from benchmarks.baseline_methods.data import Part
from benchmarks.baseline_methods.spectrum import Spectrum, eigenvalues, log_spectrum
from meshconv3d.model.mesh import Mesh
from meshconv3d.model.training.augmentation import random_rotation
from tests.meshes import cube, icosphere, sheet, together, torus


def shuffled(mesh: Mesh, seed: int = 0) -> Mesh:
    """The same triangles under other vertex numbers."""
    order = np.random.default_rng(seed).permutation(len(mesh.vertices))
    return Mesh(mesh.vertices[np.argsort(order)], order[mesh.faces])


def test_a_sphere_has_l_times_l_plus_1_for_each_of_2_l_plus_1_harmonics() -> None:
    expected = [level * (level + 1) for level in (1, 2, 3, 4) for _ in range(2 * level + 1)]
    assert eigenvalues(icosphere(4), 24) == pytest.approx(expected, rel=0.02)


def test_a_flat_rectangle_has_those_of_a_drum_with_a_free_rim() -> None:
    columns, rows = 40, 20
    flat = sheet(columns, rows)
    x, y = np.meshgrid(np.arange(columns + 1) / 20, np.arange(rows + 1) / 20, indexing="ij")
    flat = flat.moved(np.stack([x, y, 0 * x], axis=-1).reshape(-1, 3))
    expected = sorted(np.pi**2 * ((m / 2) ** 2 + n**2) for m in range(9) for n in range(9))[1:9]
    assert eigenvalues(flat, 8) == pytest.approx(expected, rel=0.02)


def test_parts_have_the_eigenvalues_of_each() -> None:
    ball = icosphere(2)
    pair = together(ball, ball.moved(ball.vertices * 2 + 5))
    alone = eigenvalues(ball, 10)
    both = np.sort(np.concatenate([alone, alone / 4]))[:10]
    assert eigenvalues(pair, 10) == pytest.approx(both)


def test_a_small_mesh_repeats_its_last() -> None:
    values = eigenvalues(cube(), 24)
    assert values.shape == (24,)
    assert (values[:7] > 0).all()
    assert (values[7:] == values[6]).all()


@pytest.mark.parametrize("mesh", [torus(), sheet(), icosphere(2)], ids=["torus", "sheet", "ball"])
def test_position_size_and_numbering_change_nothing(mesh: Mesh) -> None:
    turned = mesh.vertices @ random_rotation(np.random.default_rng(1)).T
    moved = shuffled(mesh.moved(7 * turned + 3))
    assert log_spectrum(moved, 24) == pytest.approx(log_spectrum(mesh, 24), abs=1e-6)


def test_the_nearest_of_a_class_speaks_for_it() -> None:
    ball, ring = icosphere(2), torus()
    train = Part([ball, ring, sheet()], np.array([0, 1, 1]), np.array([2]), 3)
    test = Part([ring, ball], np.array([1, 0]), np.array([], int), 3)
    scores = Spectrum().scores(train, test, seed=0)
    assert np.isfinite(scores).all()
    assert scores.argsort()[:, ::-1].tolist() == [[1, 0, 2], [0, 1, 2]]
    assert scores.max(axis=1) == pytest.approx(0, abs=1e-6)
