"""Chirality changes its sign in the mirror, and with nothing else."""

import numpy as np
import pytest

from meshconv3d.model.chirality import are_mirror_images, chirality
from meshconv3d.model.mesh import Mesh
from meshconv3d.model.training.variation import mirrored, subdivided
from tests.meshes import cube, icosphere, together

PLACES = ((0, 0, 0, 1.0), (2, 0, 0, 0.7), (2, 1.5, 0, 0.5), (2, 1.5, 1.2, 0.3))
STEPS = subdivided(
    subdivided(
        together(*(Mesh(cube().vertices * size + place, cube().faces) for *place, size in PLACES))
    )
)


def turned(mesh: Mesh) -> Mesh:
    rotation, _ = np.linalg.qr(np.random.default_rng(0).normal(size=(3, 3)))
    rotation *= np.sign(np.linalg.det(rotation))
    return Mesh(mesh.vertices @ rotation.T * 7 + (1, 2, 3), mesh.faces[::-1])


def test_it_stays_under_motion_scale_and_order() -> None:
    assert chirality(turned(STEPS)) == pytest.approx(chirality(STEPS), rel=1e-6, abs=1e-9)


def test_it_turns_its_sign_in_the_mirror() -> None:
    assert chirality(mirrored(STEPS)) == pytest.approx(-chirality(STEPS), rel=1e-6, abs=1e-9)
    assert are_mirror_images(chirality(STEPS), chirality(mirrored(turned(subdivided(STEPS)))))
    assert not are_mirror_images(chirality(STEPS), chirality(turned(subdivided(STEPS))))


def test_symmetric_shapes_have_no_mirror_image() -> None:
    ball = Mesh(icosphere(2).vertices * (1, 2, 3), icosphere(2).faces)
    assert abs(chirality(ball)).max() < 1e-6
