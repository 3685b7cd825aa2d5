"""Polygons: N - 2 triangles each, of the polygon's own area, whatever its shape."""

import loading_builders as build
import numpy as np
import pytest

from meshconv3d.model.loading import Limits, load_mesh
from meshconv3d.model.loading.triangles import triangulate


def star(corners: int, seed: int) -> np.ndarray:
    """A polygon around the origin, of corners as far from it as chance has it (N x 2)."""
    random = np.random.default_rng(seed)
    angles = np.sort(random.uniform(0, 2 * np.pi, corners))
    far = random.uniform(0.1, 1, corners)
    return np.stack([far * np.cos(angles), far * np.sin(angles)], axis=1)


def stairs(steps: int, seed: int) -> np.ndarray:
    """Columns of chance heights, with corners in the middle of all sides."""
    heights = np.random.default_rng(seed).integers(1, 6, steps)
    outline = [(x, 0) for x in range(steps + 1)]
    for x in reversed(range(steps)):
        outline += [(x + 1, heights[x]), (x, heights[x])]
    kept = [point for n, point in enumerate(outline) if point != outline[n - 1]]
    points = np.array(kept, dtype=float)
    return np.stack([points, (points + np.roll(points, -1, axis=0)) / 2], axis=1).reshape(-1, 2)


HOLE = [(0, 0), (9, 0), (9, 9), (0, 9), (0, 0), (2, 2), (2, 4), (4, 4), (4, 2), (2, 2)]
SHAPES = {
    "L": np.array([(0, 0), (2, 0), (2, 2), (1, 2), (1, 1), (0, 1)], dtype=float),
    "C": np.array([(0, 0), (3, 0), (3, 3), (2, 3), (2, 1), (1, 1), (1, 3), (0, 3)], dtype=float),
    "arrow": np.array([(0, 0), (2, 1), (0, 2), (1, 1)], dtype=float),
    "square with a hole": np.array(HOLE, dtype=float),
    "corner twice": np.array([(0, 0), (2, 0), (2, 0), (2, 2), (1, 2), (1, 1), (0, 1)], dtype=float),
    **{f"star of {n}": star(n, n) for n in (5, 17, 100, 999)},
    **{f"stairs of {n}": stairs(n, n) for n in (2, 3, 9, 40)},
}


def shoelace(points: np.ndarray) -> float:
    x, y = points.T
    return float(abs((x * np.roll(y, -1) - y * np.roll(x, -1)).sum()) / 2)


def cut(vertices: np.ndarray, polygon: np.ndarray) -> np.ndarray:
    return triangulate(vertices, polygon, np.array([len(polygon)]), Limits())


def normals(vertices: np.ndarray, faces: np.ndarray) -> np.ndarray:
    a, b, c = (vertices[faces[:, corner]] for corner in range(3))
    return np.cross(b - a, c - a) / 2


@pytest.mark.parametrize("shape", SHAPES)
@pytest.mark.parametrize("turned", range(4))
def test_a_polygon_in_any_plane_keeps_its_area_and_outline(shape, turned):
    points = SHAPES[shape]
    random = np.random.default_rng(turned)
    rotation = np.linalg.qr(random.normal(size=(3, 3)))[0] if turned else np.eye(3)
    vertices = np.pad(points, ((0, 0), (0, 1))) @ rotation + 10 * turned
    polygon = np.roll(np.arange(len(points)), turned)[:: -1 if turned % 2 else 1]
    faces = cut(vertices, polygon)
    assert len(faces) == len(points) - 2
    areas = normals(vertices, faces)
    assert np.linalg.norm(areas, axis=1).sum() == pytest.approx(shoelace(points))
    assert np.linalg.norm(areas.sum(axis=0)) == pytest.approx(shoelace(points))
    # Wound as the polygon is, and closed against what meets it along its sides.
    sides = {
        (a, b) for face in faces.tolist() for a, b in zip(face, face[1:] + face[:1], strict=True)
    }
    assert len(sides) == 3 * len(faces)
    outer = {(a, b) for a, b in sides if (b, a) not in sides}
    assert outer == set(zip(polygon.tolist(), np.roll(polygon, -1).tolist(), strict=True))


def test_convex_polygons_and_those_that_have_no_inside_are_fans():
    angles = np.linspace(0, 2 * np.pi, 9)[:-1]
    ring = np.stack([np.cos(angles), np.sin(angles), 0.1 * np.cos(angles)], axis=1)
    straight = np.linspace([0, 0, 0], [1, 2, 3], 8)
    bow = np.array([(0, 0, 0), (1, 1, 0), (1, 0, 0), (0, 1, 0)], dtype=float)
    for vertices in (ring, ring * 1e-30, ring * 1e100, straight, bow, np.full((8, 3), np.nan)):
        polygon = np.arange(len(vertices))
        faces = cut(vertices, polygon)
        assert faces.tolist() == [[0, n, n + 1] for n in range(1, len(vertices) - 1)]


def test_saddles_and_polygons_that_cross_themselves_keep_all_corners():
    saddle = np.array([(0, 0, 0), (1, 0, 1), (1, 1, 0), (0, 1, 1)], dtype=float)
    assert len(np.unique(cut(saddle, np.arange(4)))) == 4
    crossing = np.random.default_rng(0).normal(size=(200, 3))
    faces = cut(crossing, np.arange(200))
    assert faces.shape == (198, 3)
    assert len(np.unique(faces)) == 200


def test_all_formats_cut_alike_and_keep_the_order_of_faces():
    outline = SHAPES["C"]
    vertices = np.concatenate([np.insert(outline, 2, z, axis=1) for z in (0, 1)])
    count = len(outline)
    sides = [(n, (n + 1) % count, (n + 1) % count + count, n + count) for n in range(count)]
    polygons = [range(count)[::-1], *sides, range(count, 2 * count)]
    faces = [[len(polygon), *polygon] for polygon in polygons]
    points = build.rows(vertices)
    obj = build.rows(vertices, "v ") + build.rows([[n + 1 for n in p] for p in polygons], "f ")
    off = f"OFF\n{len(vertices)} {len(faces)} 0\n{points}{build.rows(faces)}"
    head = build.ply_header("ascii", len(faces)).replace(b"vertex 8", b"vertex 16").decode()
    meshes = [
        load_mesh(text.encode(), extension)
        for extension, text in (
            ("obj", obj),
            ("off", off),
            ("ply", head + points + build.rows(faces)),
        )
    ]
    for mesh in meshes:
        assert np.array_equal(mesh.faces, meshes[0].faces)
        assert build.area(mesh) == pytest.approx(2 * 7 + 16)
        assert build.volume(mesh) == pytest.approx(7)
        assert mesh.faces[6:22].reshape(8, 6)[:, :2].tolist() == [[a, b] for a, b, *_ in sides]
