"""Simplification meets the face budget from above, and keeps topology and shape."""

import time

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from meshconv3d.model.mesh import Mesh
from meshconv3d.model.preparation import prepare, prepare_placed, surface_area
from meshconv3d.model.preparation.cleaning import CleanSurface, clean
from meshconv3d.model.preparation.simplification import simplify
from meshconv3d.model.topology.halfedges import find_twins
from tests.meshes import cube, icosphere, sheet, together, torus
from tests.surfaces import MANIFOLD, Triangles, triangles

BUDGET = 500


def simplified(surface: CleanSurface, budget: int) -> tuple[NDArray, NDArray[np.int32]]:
    return simplify(surface.vertices, surface.faces, surface.twin, budget)[:2]


def euler_characteristic(faces: NDArray[np.int32]) -> int:
    twin, border, _ = find_twins(faces, int(faces.max()) + 1)
    return len(np.unique(faces)) - (len(twin) + border) // 2 + len(faces)


def border_loops(faces: NDArray[np.int32]) -> int:
    """Closed lines of border edges; fails where two of them meet in a vertex."""
    twin, _, _ = find_twins(faces, int(faces.max()) + 1)
    following = {}
    for h in np.flatnonzero(twin < 0):
        start = int(faces[h // 3, h % 3])
        assert start not in following
        following[start] = int(faces[h // 3, (h % 3 + 1) % 3])
    loops = 0
    while following:
        loops += 1
        vertex = next(iter(following))
        while vertex in following:
            vertex = following.pop(vertex)
    return loops


def runs_alike(faces: NDArray[np.int32]) -> bool:
    """Whether the faces at each inner edge run along it in opposite directions."""
    twin, _, _ = find_twins(faces, int(faces.max()) + 1)
    h = np.flatnonzero(twin >= 0)
    start = faces.reshape(-1)
    end = np.roll(faces, -1, axis=1).reshape(-1)
    return bool((start[h] == end[twin[h]]).all())


@settings(max_examples=40, deadline=None)
@given(triangles(MANIFOLD, most=150), st.integers(1, 60))
def test_collapses_keep_the_topology_of_every_surface(surface: Triangles, budget: int) -> None:
    start = clean(surface.mesh())
    if len(start.faces) <= budget:
        return
    vertices, faces = simplified(start, budget)
    assert len(np.unique(faces)) == len(vertices)
    assert find_twins(faces, len(vertices))[2] == 0
    assert runs_alike(faces)
    assert euler_characteristic(faces) == euler_characteristic(start.faces)
    assert border_loops(faces) == border_loops(start.faces)


def double_torus(rings: int = 60, sides: int = 30) -> Mesh:
    """Two tori joined where a face of each was, so that the genus is 2."""
    ring = torus(rings, sides)
    removed = ring.faces[0]
    count = len(ring.vertices)
    mirror = ring.vertices * [-1, 1, 1]
    names = np.arange(count) + count
    names[removed] = removed
    faces = np.concatenate([ring.faces[1:], names[ring.faces[1:, ::-1]]])
    return Mesh(np.concatenate([ring.vertices, mirror]), faces)


@pytest.mark.parametrize(
    ("mesh", "characteristic"),
    [(icosphere(3), 2), (torus(40, 20), 0), (torus(160, 80), 0), (double_torus(), -2)],
    ids=["sphere", "torus", "fine torus", "two handles"],
)
@pytest.mark.parametrize("budget", [500, 120])
def test_a_closed_mesh_meets_the_budget_and_keeps_its_handles(
    mesh: Mesh, characteristic: int, budget: int
) -> None:
    surface = clean(mesh)
    vertices, faces = simplified(surface, budget)
    assert len(faces) == budget
    assert find_twins(faces, len(vertices))[1:] == (0, 0)
    assert euler_characteristic(faces) == characteristic


@pytest.mark.parametrize("levels", [3, 5])
def test_a_sphere_stays_one_to_a_hundredth_of_its_radius(levels: int) -> None:
    prepared, _ = prepare(icosphere(levels), BUDGET)
    vertices = prepared.vertices
    centroids = vertices[prepared.faces].mean(axis=1)
    radius = np.linalg.norm(vertices, axis=1).mean()
    # The chords of 500 even faces of a unit sphere are up to 0.02 inside it.
    assert np.linalg.norm(vertices, axis=1) == pytest.approx(radius, rel=0.01)
    assert np.linalg.norm(centroids, axis=1) == pytest.approx(radius, rel=0.035)


def test_an_open_sheet_keeps_its_border() -> None:
    surface = clean(sheet(60, 60))
    vertices, faces = simplified(surface, BUDGET)
    assert len(faces) in (BUDGET - 1, BUDGET)
    assert border_loops(faces) == 1
    extent = np.ptp(vertices, axis=0)
    assert extent == pytest.approx(np.ptp(surface.vertices, axis=0), rel=0.03)


def grid(columns: int, rows: int) -> Mesh:
    """A flat rectangle of 2 * columns * rows faces."""
    x, y = np.meshgrid(np.arange(columns + 1), np.arange(rows + 1), indexing="ij")
    index = np.arange(x.size).reshape(x.shape)
    a, b, c, d = index[:-1, :-1], index[1:, :-1], index[1:, 1:], index[:-1, 1:]
    faces = np.concatenate([np.stack([a, b, c], -1), np.stack([a, c, d], -1)]).reshape(-1, 3)
    return Mesh(np.stack([x, y, 0 * x], -1).reshape(-1, 3), faces)


def test_a_flat_region_stays_flat_and_its_faces_even() -> None:
    surface = clean(grid(50, 50))
    vertices, faces = simplified(surface, BUDGET)
    assert np.ptp(vertices[:, 2]) < 1e-9
    assert surface_area(vertices, faces) == pytest.approx(1, rel=1e-3)
    a, b, c = vertices[faces].transpose(1, 0, 2)
    areas = np.cross(b - a, c - a)[:, 2] / 2
    assert areas.min() > 0 or areas.max() < 0
    longest = np.max([np.linalg.norm(q - p, axis=1) for p, q in ((a, b), (b, c), (c, a))], axis=0)
    # Of an equilateral triangle, 0.43.
    assert np.median(np.abs(areas) / longest**2) > 0.2


def box(columns: int) -> Mesh:
    """A cube whose sides are grids."""
    side = grid(columns, columns)
    flat = side.vertices / columns - [0.5, 0.5, -0.5]
    sides = [side.moved(np.roll(flat * [1, 1, z], k, axis=1)) for k in range(3) for z in (1, -1)]
    return together(*sides)


def test_a_cube_keeps_its_corners() -> None:
    prepared, report = prepare(box(20), BUDGET)
    assert report.watertight
    assert report.within_budget
    # A cube in the unit sphere has sides of 2 / sqrt(3).
    assert surface_area(prepared.vertices, prepared.faces) == pytest.approx(8, rel=1e-4)
    corners = np.abs(prepared.vertices).min(axis=1) > 0.99 / np.sqrt(3)
    assert np.count_nonzero(corners) == 8


def test_a_mesh_of_many_parts_meets_the_budget_without_its_smallest() -> None:
    sizes = np.linspace(0.4, 1, 200)
    parts = [cube().moved(cube().vertices * size + [2 * i, 0, 0]) for i, size in enumerate(sizes)]
    prepared, report, placement = prepare_placed(together(*parts), BUDGET)
    assert report.within_budget
    # A closed part has four faces at least.
    assert report.components_lost >= 200 - BUDGET // 4
    assert report.note == f"{report.components_lost} of 200 parts were dropped"
    _, border, _ = find_twins(prepared.faces, len(prepared.vertices))
    assert border == 0
    # They lie in a row, the smallest first.
    assert placement.into_file(prepared.vertices)[:, 0].min() > 2 * report.components_lost - 1


def wheel(spokes: int, heights: tuple[float, ...]) -> Mesh:
    """A disc as a fan around its centre, or two of them around one rim."""
    angle = 2 * np.pi * np.arange(spokes) / spokes
    rim = np.stack([np.cos(angle), np.sin(angle), 0 * angle], axis=1)
    i, j = np.arange(spokes), (np.arange(spokes) + 1) % spokes
    hubs = [[0, 0, height] for height in heights]
    fans = [
        np.stack([i, j, np.full(spokes, spokes + k)], axis=1)[:, :: 1 - 2 * k]
        for k in range(len(heights))
    ]
    return Mesh(np.concatenate([rim, hubs]), np.concatenate(fans))


def polygon(corners: int) -> Mesh:
    """A convex polygon, cut from one of its corners."""
    angle = 2 * np.pi * np.arange(corners) / corners
    i = np.arange(1, corners - 1)
    return Mesh(
        np.stack([np.cos(angle), np.sin(angle), 0 * angle], 1), np.stack([0 * i, i, i + 1], 1)
    )


@pytest.mark.parametrize(
    "mesh",
    [wheel(20_000, (1, -1)), wheel(40_000, (1,)), wheel(40_000, (0,)), polygon(20_000)],
    ids=["double cone", "cone", "disc", "polygon"],
)
def test_a_vertex_of_thousands_of_faces_takes_no_longer(mesh: Mesh) -> None:
    prepare(wheel(2000, (1,)), BUDGET)
    started = time.process_time()
    _, report = prepare(mesh, BUDGET)
    # In quadratic time it would be minutes.
    assert time.process_time() - started < 10
    assert report.within_budget
    assert report.area_kept == pytest.approx(1, abs=0.01)


@pytest.mark.parametrize("mesh", [torus(60, 30), sheet(40, 40), grid(30, 30), box(12)])
def test_the_numbering_of_the_file_changes_nothing(mesh: Mesh) -> None:
    random = np.random.default_rng(0)
    places = random.permutation(len(mesh.vertices))
    vertices = np.empty_like(mesh.vertices)
    vertices[places] = mesh.vertices
    faces = places[mesh.faces][random.permutation(len(mesh.faces))]
    turns = random.integers(0, 3, (len(faces), 1))
    faces = np.take_along_axis(faces, (np.arange(3) + turns) % 3, axis=1)
    one, report = prepare(mesh, BUDGET)
    other, other_report = prepare(Mesh(vertices, faces), BUDGET)
    assert report == other_report
    assert one.vertices.tobytes() == other.vertices.tobytes()
    assert one.faces.tobytes() == other.faces.tobytes()


def test_what_is_prepared_lies_where_the_file_has_it() -> None:
    mesh = torus(160, 80)
    mesh = mesh.moved(mesh.vertices * 30 + [5, -7, 100])
    prepared, report, placement = prepare_placed(mesh, BUDGET)
    assert report.faces_used == BUDGET
    assert report.area_kept == pytest.approx(1, abs=0.02)
    placed = placement.into_file(prepared.vertices)
    assert placed.min(axis=0) == pytest.approx(mesh.vertices.min(axis=0), abs=0.6)
    assert placed.max(axis=0) == pytest.approx(mesh.vertices.max(axis=0), abs=0.6)
