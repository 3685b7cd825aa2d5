"""The point network and its samples."""

from dataclasses import replace

import numpy as np
import pytest
import torch

from benchmarks.baseline_methods.data import Part
from benchmarks.baseline_methods.point_network import PointNetwork
from benchmarks.baseline_methods.points import Points
from benchmarks.baseline_methods.surface_samples import sample_surface
from meshconv3d.model.mesh import Mesh
from meshconv3d.model.training.augmentation import random_rotation
from tests.meshes import cube, icosphere, sheet, torus

SHORT = Points(epochs=25, batch_size=4, learning_rate=1e-2)


def part(*meshes: Mesh) -> Part:
    """Meshes of classes 0, 1, 0, 1, ..."""
    return Part([*meshes], np.arange(len(meshes)) % 2, np.array([], int), 2)


def test_points_lie_on_the_faces_in_shares_of_their_area() -> None:
    mesh = cube()
    points, normals = sample_surface(mesh.vertices, mesh.faces, 20000, np.random.default_rng(0))
    assert np.mean(np.sum(points**2, axis=1)) == pytest.approx(1)
    assert np.linalg.norm(normals, axis=1) == pytest.approx(1)
    # Each side is as far from the centre as its normal says, and has a sixth of the points.
    apart = np.einsum("nk,nk->n", points, normals)
    assert apart == pytest.approx(apart.mean(), abs=0.03)
    sides, counts = np.unique(normals.round(), axis=0, return_counts=True)
    assert len(sides) == 6
    assert counts / 20000 == pytest.approx(1 / 6, abs=0.01)


def test_faces_without_area_get_no_points() -> None:
    mesh = cube()
    faces = np.concatenate([[[0, 0, 1]], mesh.faces, [[2, 3, 3]]]).astype(np.int32)
    _, normals = sample_surface(mesh.vertices, faces, 5000, np.random.default_rng(0))
    assert np.linalg.norm(normals, axis=1) == pytest.approx(1)


def test_scores_do_not_depend_on_rotation_or_on_the_sign_of_normals() -> None:
    torch.manual_seed(0)
    network = PointNetwork(5).eval()
    mesh, rng = torus(), np.random.default_rng(0)
    points, normals = sample_surface(mesh.vertices, mesh.faces, 512, rng)
    turn = random_rotation(rng)
    signs = rng.choice([-1, 1], (512, 1))
    with torch.inference_mode():
        before, after = (
            network(*(torch.from_numpy(a[None].astype(np.float32)) for a in arrays))
            for arrays in ((points, normals), (points @ turn.T, signs * normals @ turn.T))
        )
    assert after.numpy() == pytest.approx(before.numpy(), abs=1e-3)


def test_it_is_as_small_as_ours() -> None:
    assert sum(weight.numel() for weight in PointNetwork(69).parameters()) < 300_000


def test_it_learns_balls_from_sheets_and_repeats_itself() -> None:
    train = part(*[icosphere(2), sheet()] * 4)
    test = part(icosphere(3), sheet(12, 14))
    scores = SHORT.scores(train, test, seed=1)
    assert scores.sum(axis=1) == pytest.approx(1)
    assert scores.argmax(axis=1).tolist() == [0, 1]
    assert (scores == SHORT.scores(train, test, seed=1)).all()
    assert (scores != replace(SHORT, epochs=2).scores(train, test, seed=1)).all()
