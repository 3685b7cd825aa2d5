"""Meshes of known kinds."""

from pathlib import Path

import numpy as np

from meshconv3d.model.mesh import Mesh


def torus(rings: int = 25, sides: int = 10, radius: float = 1.0, tube: float = 0.4) -> Mesh:
    """A closed torus of 2 * rings * sides faces, irregular enough to have no exact ties."""
    u, v = np.meshgrid(np.arange(rings), np.arange(sides), indexing="ij")
    noise = np.random.default_rng(7).uniform(-0.2, 0.2, (2, rings, sides))
    a, b = 2 * np.pi * (u + noise[0]) / rings, 2 * np.pi * (v + noise[1]) / sides
    ring = radius + tube * np.cos(b)
    vertices = np.stack([ring * np.cos(a), ring * np.sin(a), tube * np.sin(b)], -1).reshape(-1, 3)
    right, up = (u + 1) % rings, (v + 1) % sides
    corner = [i * sides + j for i, j in ((u, v), (right, v), (right, up), (u, up))]
    lower = np.stack([corner[0], corner[1], corner[2]], -1).reshape(-1, 3)
    upper = np.stack([corner[0], corner[2], corner[3]], -1).reshape(-1, 3)
    return Mesh(vertices, np.concatenate([lower, upper]))


def sheet(columns: int = 16, rows: int = 16) -> Mesh:
    """An open, slightly wavy sheet of 2 * columns * rows faces."""
    x, y = np.meshgrid(np.arange(columns + 1), np.arange(rows + 1), indexing="ij")
    noise = np.random.default_rng(3).uniform(-0.2, 0.2, (3, *x.shape))
    vertices = np.stack([x + noise[0], y + noise[1], np.sin(x / 3) + noise[2]], -1).reshape(-1, 3)
    index = np.arange(x.size).reshape(x.shape)
    a, b, c, d = index[:-1, :-1], index[1:, :-1], index[1:, 1:], index[:-1, 1:]
    faces = np.concatenate([np.stack([a, b, c], -1), np.stack([a, c, d], -1)])
    return Mesh(vertices, faces.reshape(-1, 3))


def cube() -> Mesh:
    """The unit cube in 12 faces, wound outward; corner 4 x + 2 y + z."""
    corners = np.array([[x, y, z] for x in (0, 1) for y in (0, 1) for z in (0, 1)])
    quads = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]
    return Mesh(corners, [t for a, b, c, d in quads for t in ((a, b, c), (a, c, d))])


def icosphere(levels: int = 3) -> Mesh:
    """A unit sphere of 20 * 4^levels faces, wound outward."""
    golden = (1 + 5**0.5) / 2
    poles = np.array([(0, i, j * golden) for i in (1, -1) for j in (1, -1)])
    points = [tuple(p) for k in range(3) for p in np.roll(poles, k, axis=1)]
    near = np.linalg.norm(np.subtract.outer(points, points).diagonal(0, 1, 3), axis=2) < 2.1
    faces = [
        (a, b, c) if np.linalg.det([points[a], points[b], points[c]]) > 0 else (a, c, b)
        for a in range(12)
        for b in range(a)
        for c in range(b)
        if near[a, b] and near[b, c] and near[c, a]
    ]
    for _ in range(levels):
        middles: dict[tuple[int, int], int] = {}

        def middle(a: int, b: int, middles: dict[tuple[int, int], int] = middles) -> int:
            key = (min(a, b), max(a, b))
            if key not in middles:
                middles[key] = len(points)
                points.append(tuple((np.array(points[a]) + points[b]) / 2))
            return middles[key]

        faces = [
            face
            for a, b, c in faces
            for ab, bc, ca in [(middle(a, b), middle(b, c), middle(c, a))]
            for face in ((a, ab, ca), (ab, b, bc), (ca, bc, c), (ab, bc, ca))
        ]
    vertices = np.array(points)
    return Mesh(vertices / np.linalg.norm(vertices, axis=1, keepdims=True), faces)


def moebius(segments: int = 24) -> Mesh:
    """A one-sided strip of 2 * segments faces."""
    angle = 2 * np.pi * np.arange(segments) / segments
    rows = []
    for side in (-0.3, 0.3):
        reach = 1 + side * np.cos(angle / 2)
        rows.append([reach * np.cos(angle), reach * np.sin(angle), side * np.sin(angle / 2)])
    faces = []
    for i in range(segments):
        j = (i + 1) % segments
        a, b = i, i + segments
        c, d = (j, j + segments) if j else (segments, 0)
        faces += [(a, c, d), (a, d, b)]
    return Mesh(np.concatenate(rows, axis=1).T, faces)


def together(*meshes: Mesh) -> Mesh:
    """Several meshes as one of several components, each where it was."""
    starts = np.cumsum([0, *(len(mesh.vertices) for mesh in meshes)])
    faces = [mesh.faces + start for mesh, start in zip(meshes, starts, strict=False)]
    return Mesh(np.concatenate([mesh.vertices for mesh in meshes]), np.concatenate(faces))


def soup(mesh: Mesh) -> Mesh:
    """The same triangles with three vertices each, as STL stores them."""
    return Mesh(mesh.vertices[mesh.faces].reshape(-1, 3), np.arange(mesh.faces.size).reshape(-1, 3))


def placed_triangles(vertices: np.ndarray, faces: np.ndarray) -> np.ndarray:
    """The triangles as F x 3 x 3 points, alike however they are numbered, but not if turned over.

    Ordered by coordinates to four digits: those of the welding grid differ in the seventh.
    """
    corners = np.asarray(vertices)[faces]
    ranks = [sorted(range(3), key=lambda s, face=face: tuple(face[s])) for face in corners.round(4)]
    turned = np.stack(
        [np.roll(face, -rank[0], 0) for face, rank in zip(corners, ranks, strict=True)]
    )
    return turned[np.lexsort(turned.round(4).reshape(len(turned), 9).T[::-1])]


def write_off(path: Path, mesh: Mesh) -> None:
    """Write a mesh as OFF, into a folder that is made for it."""
    path.parent.mkdir(parents=True, exist_ok=True)
    rows = [f"OFF {len(mesh.vertices)} {len(mesh.faces)} 0"]
    rows += [f"{x} {y} {z}" for x, y, z in mesh.vertices.tolist()]
    rows += [f"3 {a} {b} {c}" for a, b, c in mesh.faces.tolist()]
    path.write_text("\n".join([*rows, ""]))
