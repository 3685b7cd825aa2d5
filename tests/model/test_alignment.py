"""A mesh's own axes: the same however it lies and however it is cut into triangles."""

from dataclasses import replace

import numpy as np
import pytest

from model.alignment import FLIPS, into_principal_axes
from model.augmentation import random_rotation
from model.config import NetworkConfig
from model.inputs import mesh_inputs
from model.mesh import Mesh
from model.preparation import into_unit_sphere, prepare
from model.variation import subdivided
from tests.meshes import sheet, torus


def lopsided() -> Mesh:
    """A torus with three different extents, thicker on one side in each direction."""
    mesh = torus()
    x, y, z = mesh.vertices.T
    bent = mesh.vertices * [1.0, 0.6, 0.5] * np.exp(0.3 * np.array([x, y, z + 0.5 * x]).T)
    return Mesh(into_unit_sphere(bent, mesh.faces), mesh.faces)


def aligned(mesh: Mesh) -> np.ndarray:
    return into_principal_axes(mesh.vertices, mesh.faces)


def test_lengths_and_handedness_stay() -> None:
    mesh = lopsided()
    before, after = mesh.vertices, aligned(mesh)
    assert after @ after.T == pytest.approx(before @ before.T, abs=1e-12)
    volumes = [np.linalg.det(v[mesh.faces]).sum() for v in (before, after)]
    assert volumes[0] == pytest.approx(volumes[1])


@pytest.mark.parametrize("seed", range(5))
def test_however_it_lies(seed: int) -> None:
    mesh = lopsided()
    turned = mesh.moved(mesh.vertices @ random_rotation(np.random.default_rng(seed)).T)
    assert aligned(turned) == pytest.approx(aligned(mesh), abs=1e-9)


def test_however_it_is_triangulated() -> None:
    mesh = lopsided()
    finer = aligned(subdivided(mesh))
    # Subdivision keeps the vertices that were there, first.
    assert finer[: len(mesh.vertices)] == pytest.approx(aligned(mesh), abs=1e-9)


def test_the_first_axis_is_the_widest_and_points_to_the_longer_tail() -> None:
    points = aligned(lopsided())
    assert list(np.argsort(-points.var(axis=0))) == [0, 1, 2]
    assert points[:, 0].max() > -points[:, 0].min()


def test_a_flip_is_a_rotation() -> None:
    assert all(np.prod(flip) == 1 for flip in FLIPS)
    assert len(np.unique(FLIPS, axis=0)) == 4


@pytest.mark.parametrize("mesh", [lopsided(), sheet()], ids=["closed", "open"])
def test_terms_do_not_depend_on_how_the_mesh_lies(mesh: Mesh) -> None:
    turned = mesh.moved(mesh.vertices @ random_rotation(np.random.default_rng(1)).T)
    given = NetworkConfig(classes=("a",))
    for config, same in ((replace(given, axes="principal"), True), (given, False)):
        one, two = (prepare(m, 500)[0] for m in (mesh, turned))
        # Faces are ordered by where they lie: compare the sums over all of them.
        sums = [np.abs(mesh_inputs(m, config).terms).sum(axis=0) for m in (one, two)]
        assert (sums[0] == pytest.approx(sums[1], rel=1e-3)) == same
