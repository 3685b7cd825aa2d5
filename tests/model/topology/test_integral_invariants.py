"""What lies around a face, against the same measures written with NumPy on a dense sampling."""

import numpy as np
import pytest

from meshconv3d.model.mesh import Mesh
from meshconv3d.model.topology.geometry import face_geometry
from meshconv3d.model.topology.integral_invariants import (
    IN_BALL,
    MEASURES,
    RADII,
    integral_invariants,
)
from meshconv3d.model.training.augmentation import random_rotation
from tests.meshes import cube, sheet, together, torus


def inside(mesh: Mesh) -> Mesh:
    """Moved and scaled into the unit sphere."""
    centred = mesh.vertices - mesh.vertices.mean(axis=0)
    return mesh.moved(centred / np.linalg.norm(centred, axis=1).max())


PARTS = inside(together(torus(12, 8), cube(), sheet(5, 4).moved(sheet(5, 4).vertices + 2)))
SURFACES = {"torus": inside(torus()), "parts": PARTS, "open": inside(sheet(9, 7))}


def measure(mesh: Mesh) -> np.ndarray:
    geometry = face_geometry(mesh.vertices, mesh.faces)
    return integral_invariants(mesh.vertices, mesh.faces, geometry)


def samples(mesh: Mesh, count: int) -> tuple[np.ndarray, np.ndarray]:
    """Points spread evenly over a surface at random, and their normals."""
    rng = np.random.default_rng(0)
    corners = mesh.vertices[mesh.faces]
    across = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    area = np.linalg.norm(across, axis=1)
    chosen = rng.choice(len(area), count, p=area / area.sum())
    places = rng.dirichlet(np.ones(3), count)
    return np.einsum("pc,pck->pk", places, corners[chosen]), (across / area[:, None])[chosen]


def by_definition(mesh: Mesh, face: int, points: np.ndarray, normals: np.ndarray) -> np.ndarray:
    """The measures of one face, over many samples of the surface."""
    a, b, c = mesh.vertices[mesh.faces[face]]
    normal = np.cross(b - a, c - a)
    normal /= np.linalg.norm(normal)
    corners = mesh.vertices[mesh.faces]
    across = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    total = np.linalg.norm(across, axis=1).sum() / 2
    offsets = points - (a + b + c) / 3
    distances = np.linalg.norm(offsets, axis=1)
    found = []
    for radius in RADII:
        near = distances <= radius
        x, m = offsets[near], normals[near]
        spread = np.linalg.eigvalsh(np.cov(x.T, bias=True))[::-1].clip(0) ** 0.5
        towards = (x * m).sum(axis=1) / distances[near]
        found += [np.log1p(total * near.mean() / (np.pi * radius**2)), *(spread / radius)]
        found += [np.linalg.norm(x.mean(axis=0)) / radius, np.abs(x @ normal).mean() / radius]
        found += [np.abs(m @ normal).mean(), (towards**2).mean()]
    middle = points.mean(axis=0)
    covariance = np.cov(points.T, bias=True)
    covariance /= np.trace(covariance)
    place = (a + b + c) / 3 - middle
    found += [np.linalg.norm(place), abs(place @ normal), (place @ covariance @ place) ** 0.5]
    found += [np.linalg.norm(covariance @ place), normal @ covariance @ normal]
    found += [np.linalg.norm(covariance @ normal), abs(place @ covariance @ normal)]
    return np.array(found)


@pytest.mark.parametrize("mesh", SURFACES.values(), ids=SURFACES.keys())
def test_measures_are_those_of_the_surface(mesh):
    measures = measure(mesh)
    assert measures.shape == (len(mesh.faces), MEASURES)
    assert measures.dtype == np.float32
    points, normals = samples(mesh, 100_000)
    for face in range(0, len(mesh.faces), len(mesh.faces) // 7):
        expected = by_definition(mesh, face, points, normals)
        # The smallest balls hold but a few faces, of which each is in or out as a whole.
        coarse = slice(2 * IN_BALL, None)
        assert measures[face, coarse] == pytest.approx(expected[coarse], abs=0.08)


@pytest.mark.parametrize("mesh", SURFACES.values(), ids=SURFACES.keys())
def test_neither_rotation_nor_the_order_of_anything_changes_them(mesh):
    rng = np.random.default_rng(1)
    before = measure(mesh)
    assert measure(mesh.moved(mesh.vertices @ random_rotation(rng).T)) == pytest.approx(
        before, abs=1e-4
    )
    order = rng.permutation(len(mesh.faces))
    shuffled = Mesh(mesh.vertices, np.roll(mesh.faces[order], 1, axis=1))
    assert measure(shuffled) == pytest.approx(before[order], abs=1e-4)
    turned = np.where(rng.random(len(mesh.faces))[:, None] < 0.5, mesh.faces[:, ::-1], mesh.faces)
    assert measure(Mesh(mesh.vertices, turned)) == pytest.approx(before, abs=1e-4)


def test_a_face_sees_a_part_that_it_does_not_touch():
    near = sheet(4, 4)
    far = near.moved(near.vertices + np.array([0, 0, 0.3]))
    alone = measure(near)
    beside = measure(together(near, far))[: len(near.faces)]
    assert np.abs(beside - alone)[:, 8 * 3 :].max() > 0.1


def test_a_sample_stands_for_many_faces():
    mesh = inside(torus(60, 40))
    assert len(mesh.faces) == 4800
    measures = measure(mesh)
    points, normals = samples(mesh, 100_000)
    for face in range(0, 4800, 601):
        expected = by_definition(mesh, face, points, normals)
        # The smallest balls hold a handful of points.
        assert measures[face, 2 * IN_BALL :] == pytest.approx(expected[2 * IN_BALL :], abs=0.05)


def test_faces_without_area_are_measured_too():
    flat = Mesh([[0, 0, 0], [0.5, 0, 0], [1, 0, 0], [0, 1, 0]], [[0, 1, 2], [0, 1, 3]])
    assert np.isfinite(measure(flat)).all()
