"""An engraved cube is closed, wound outward, of 500 faces, and lower where the outline is."""

import numpy as np
import pytest

from benchmarks.cubes.engraving import FACES, MOST_CORNERS, engrave, engraved_cube, place
from benchmarks.cubes.recipe import CubesError
from meshconv3d.model.preparation import prepare, surface_area
from meshconv3d.model.topology.halfedges import find_twins


def star(count: int, seed: int = 0) -> np.ndarray:
    """A jagged outline of `count` corners, counter-clockwise, with a long side of 1."""
    radii = np.random.default_rng(seed).uniform(0.15, 0.5, count)
    angles = 2 * np.pi * np.arange(count) / count
    corners = np.stack([radii * np.cos(angles), radii * np.sin(angles)], 1)
    corners -= (corners.min(0) + corners.max(0)) / 2
    return corners / np.ptp(corners, axis=0).max()


def outline_area(corners):
    x, y = corners.T
    return float(x @ np.roll(y, -1) - y @ np.roll(x, -1)) / 2


def perimeter(corners):
    return float(np.linalg.norm(corners - np.roll(corners, 1, 0), axis=1).sum())


def volume(vertices, faces):
    a, b, c = vertices[faces].transpose(1, 0, 2)
    return float(np.einsum("ij,ij->", a, np.cross(b, c)) / 6)


BAR = np.array([[-0.5, -0.05], [0.5, -0.05], [0.5, 0.05], [-0.5, 0.05]])
EACH_OUTLINE = pytest.mark.parametrize(
    "outline", [BAR, *(star(count) for count in (3, 17, 80, MOST_CORNERS - 1, MOST_CORNERS))]
)


@EACH_OUTLINE
def test_the_outline_is_cut_out_0_1_deep(outline):
    vertices, faces = engrave(outline)
    assert np.abs(vertices).max() == 1.5
    assert volume(vertices, faces) == pytest.approx(27 - 0.1 * outline_area(outline), abs=1e-7)
    floor = (vertices[faces][:, :, 2] == 1.4).all(axis=1)
    assert surface_area(vertices, faces[floor]) == pytest.approx(outline_area(outline))
    a, b, c = vertices[faces[floor]].transpose(1, 0, 2)
    assert (np.cross(b - a, c - a)[:, 2] > 0).all()


@EACH_OUTLINE
def test_a_cube_is_one_closed_surface_of_500_faces_wound_outward(outline):
    mesh = engraved_cube(outline, np.random.default_rng(5))
    assert len(mesh.faces) == FACES
    assert len(mesh.vertices) == 252  # Euler: no handle, one component
    twin, border, nonmanifold = find_twins(mesh.faces, len(mesh.vertices))
    assert border == nonmanifold == 0
    starts = mesh.faces.reshape(-1)
    ends = np.roll(mesh.faces, -1, axis=1).reshape(-1)
    assert np.array_equal(starts[twin], ends)
    assert volume(mesh.vertices, mesh.faces) == pytest.approx(27 - 0.1 * outline_area(outline))
    # Triangles that are folded over would add to the area.
    area = 54 + 0.1 * perimeter(outline)
    assert surface_area(mesh.vertices, mesh.faces) == pytest.approx(area)


@pytest.mark.parametrize("seed", range(8))
def test_preparation_changes_no_cube(seed):
    mesh = engraved_cube(star(40 + 10 * seed, seed), np.random.default_rng(seed))
    prepared, report = prepare(mesh, FACES)
    assert (len(prepared.faces), len(prepared.vertices)) == (FACES, len(mesh.vertices))
    assert (report.resampled, report.watertight, report.flipped) == ("none", True, 0)
    assert (report.components, report.nonmanifold_edges, report.vertices_split) == (1, 0, 0)


def test_place_rotation_and_cube_are_drawn_at_random():
    cubes = [engraved_cube(star(20), np.random.default_rng(seed)) for seed in (1, 1, 2)]
    assert np.array_equal(cubes[0].vertices, cubes[1].vertices)
    assert np.array_equal(cubes[0].faces, cubes[1].faces)
    assert not np.array_equal(cubes[0].vertices, cubes[2].vertices)
    corners = [np.argsort(-np.linalg.norm(cube.vertices, axis=1))[:8] for cube in cubes]
    assert np.linalg.norm(cubes[0].vertices[corners[0]], axis=1) == pytest.approx(1.5 * 3**0.5)
    assert np.abs(cubes[0].vertices[corners[0]]).max() > 1.6


def test_an_engraving_stays_on_its_face_and_reaches_all_of_it():
    rng = np.random.default_rng(0)
    square = np.array([[-0.5, -0.5], [0.5, -0.5], [0.5, 0.5], [-0.5, 0.5]])
    placed = np.array([place(square, rng) for _ in range(500)])
    assert 1.4 < np.abs(placed).max() <= 1.45
    middles = placed.mean(axis=1)
    assert np.abs(middles).max() <= 0.9
    assert np.abs(middles.mean(axis=0)).max() < 0.1
    sides = np.linalg.norm(placed[:, 1] - placed[:, 0], axis=1)
    assert sides == pytest.approx(1.0)
    turns = np.arctan2(*(placed[:, 1] - placed[:, 0]).T)
    assert np.histogram(turns, 4, (-np.pi, np.pi))[0].min() > 80


@pytest.mark.parametrize(
    ("outline", "says"),
    [
        (star(MOST_CORNERS + 1), "has 504 faces, not 500"),
        (star(20) + np.array([1.3, 0]), "has volume"),
        (BAR[[0, 2, 1, 3]], "has volume"),
        (BAR[::-1], "cannot be engraved"),
    ],
    ids=["too many corners", "over the edge", "crossing itself", "clockwise"],
)
def test_a_cube_that_came_out_wrong_is_refused(outline, says):
    with pytest.raises(CubesError, match=says):
        engrave(outline)


def test_an_outline_that_cannot_be_engraved_in_one_place_is_put_elsewhere(monkeypatch):
    """As the next place of the same generator would have it."""
    refused = iter([True, True, False])

    def some(outline):
        if next(refused):
            raise CubesError("502 faces")
        return engrave(outline)

    monkeypatch.setattr("benchmarks.cubes.engraving.engrave", some)
    rng = np.random.default_rng(5)
    cube = engraved_cube(BAR, rng)
    again = np.random.default_rng(5)
    for _ in range(2):
        place(BAR, again)
    assert np.array_equal(cube.faces, engrave(place(BAR, again))[1])
