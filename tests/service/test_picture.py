"""Small pictures of meshes."""

from io import BytesIO

import numpy as np
import pytest
from numpy.typing import NDArray
from PIL import Image

from meshconv3d.model.loading import load_mesh
from meshconv3d.model.mesh import Mesh
from meshconv3d.model.preparation import prepare
from meshconv3d.service.picture import SIZE, picture
from tests.articulated import sample_paths
from tests.meshes import icosphere, sheet, torus


def drawn(mesh: Mesh, size: int = SIZE) -> NDArray[np.uint8]:
    """Size x size x 4."""
    with Image.open(BytesIO(picture(mesh, size))) as image:
        assert image.format == "PNG"
        assert image.size == (size, size)
        return np.asarray(image.convert("RGBA"))


def covered(mesh: Mesh) -> NDArray[np.bool_]:
    return drawn(mesh)[..., 3] > 127


def test_a_ball_is_a_disc_in_the_middle() -> None:
    pixels = covered(icosphere())
    y, x = np.nonzero(pixels)
    radius = 0.46 * SIZE
    assert np.hypot(x + 0.5 - SIZE / 2, y + 0.5 - SIZE / 2).max() < radius + 1
    assert pixels.sum() == pytest.approx(np.pi * radius**2, rel=0.03)


def test_a_ball_is_brighter_at_the_upper_left() -> None:
    shades = drawn(icosphere())[..., 0].astype(float)
    upper_left, lower_right = shades[30:40, 30:40], shades[66:76, 66:76]
    assert upper_left.mean() > lower_right.mean() + 50


def test_what_is_nearer_hides_what_is_behind() -> None:
    """A large dark face before a bright one, however they are listed."""
    towards = np.array([0.54, 0.34, 0.77])
    across = np.cross([0, 1, 0], towards)
    up = np.cross(towards, across)
    corners = np.array([across, up - across, -up - across])
    tilted = corners + np.array([[0], [1], [-1]]) * -0.9 * towards
    vertices = np.concatenate([corners + 3 * towards, 0.3 * tilted])
    front = Mesh(vertices[:3], [[0, 1, 2]])
    for faces in ([[0, 1, 2], [3, 4, 5]], [[3, 4, 5], [0, 1, 2]]):
        both = drawn(Mesh(vertices, faces))
        assert np.array_equal(both, drawn(front))


def test_size_and_place_do_not_matter_and_the_hole_of_a_ring_is_seen() -> None:
    ring = torus()
    first = drawn(ring)
    assert np.abs(first.astype(int) - drawn(ring.moved(ring.vertices * 1e3 + 7))).mean() < 1
    assert first[SIZE // 2, SIZE // 2, 3] == 0


def test_a_sheet_is_lit_from_both_sides() -> None:
    mesh = sheet()
    turned = Mesh(mesh.vertices, mesh.faces[:, ::-1])
    assert np.array_equal(drawn(mesh), drawn(turned))


@pytest.mark.parametrize("sample", sorted(sample_paths()))
def test_a_picture_is_small_and_fills_its_frame(sample: str) -> None:
    mesh, _ = prepare(load_mesh(sample_paths()[sample]), 500)
    assert len(picture(mesh)) < 2000
    y, x = np.nonzero(covered(mesh))
    assert max(np.ptp(x), np.ptp(y)) >= 0.85 * SIZE
    assert min(x.min(), y.min()) > 0
    assert max(x.max(), y.max()) < SIZE - 1


def test_any_size() -> None:
    assert (drawn(torus(), 32)[..., 3] > 127).any()
