"""Shapes of no class, made by formulas, which a classifier should call unknown."""

from collections.abc import Callable, Iterator

import numpy as np
import scipy.spatial
import trimesh

from meshconv3d.model.mesh import Mesh
from meshconv3d.model.training.augmentation import random_rotation

Generator = np.random.Generator


def cuboid(rng: Generator) -> Mesh:
    """A box of any proportions."""
    return _plain(trimesh.creation.box(extents=rng.uniform(0.2, 1, 3)))


def prism(rng: Generator) -> Mesh:
    """Three to nine flat sides."""
    return _plain(
        trimesh.creation.cylinder(
            radius=rng.uniform(0.2, 1),
            height=rng.uniform(0.3, 2),
            sections=int(rng.integers(3, 10)),
        )
    )


def cone(rng: Generator) -> Mesh:
    """A round cone, flat to pointed."""
    return _plain(trimesh.creation.cone(rng.uniform(0.2, 1), rng.uniform(0.3, 2), sections=40))


def ring(rng: Generator) -> Mesh:
    """A torus, thin to fat."""
    return _plain(trimesh.creation.torus(1, rng.uniform(0.1, 0.6)))


def pipe(rng: Generator) -> Mesh:
    """A thick-walled tube."""
    inner = rng.uniform(0.2, 0.9)
    return _plain(trimesh.creation.annulus(inner, 1, rng.uniform(0.2, 3)))


def hull(rng: Generator) -> Mesh:
    """The convex hull of random points: a pebble with corners."""
    points = rng.normal(size=(int(rng.integers(6, 30)), 3)) * rng.uniform(0.5, 1, 3)
    faces = scipy.spatial.ConvexHull(points).simplices
    return Mesh(points, faces)


def superquadric(rng: Generator) -> Mesh:
    """Anything between a ball, a cube, a barrel and a star."""
    ball = trimesh.creation.icosphere(subdivisions=3)
    powers = rng.uniform(0.4, 2.5, 2)[[0, 0, 1]]
    points = np.sign(ball.vertices) * np.abs(ball.vertices) ** powers * rng.uniform(0.4, 1, 3)
    return Mesh(points, ball.faces)


def blob(rng: Generator) -> Mesh:
    """A ball with a few random smooth bumps and dents."""
    ball = trimesh.creation.icosphere(subdivisions=3)
    directions = rng.normal(size=(8, 3))
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    bumps = np.exp(6 * (ball.vertices @ directions.T - 1)) @ rng.uniform(-0.6, 1.2, 8)
    return Mesh(ball.vertices * (1 + bumps)[:, None], ball.faces)


def urchin(rng: Generator) -> Mesh:
    """A ball with one vertex in ten pulled out to a spike."""
    ball = trimesh.creation.icosphere(subdivisions=3)
    spikes = rng.random(len(ball.vertices)) < 0.1
    return Mesh(ball.vertices * (1 + spikes * rng.uniform(0.3, 2))[:, None], ball.faces)


def knot(rng: Generator) -> Mesh:
    """A closed tube that winds p times round a torus and q times through it."""
    p, q = [(2, 3), (3, 2), (2, 5), (3, 4)][rng.integers(4)]
    t = np.linspace(0, 2 * np.pi, 161)
    radius = 2 + np.cos(q * t)
    path = np.stack([radius * np.cos(p * t), radius * np.sin(p * t), np.sin(q * t)], axis=1)
    return _tube(path, rng.uniform(0.15, 0.4))


def spring(rng: Generator) -> Mesh:
    """A coil of three to eight turns."""
    turns = rng.uniform(3, 8)
    t = np.linspace(0, 2 * np.pi * turns, int(30 * turns))
    path = np.stack([np.cos(t), np.sin(t), t * rng.uniform(0.05, 0.15)], axis=1)
    return _tube(path, rng.uniform(0.08, 0.2))


def terrain(rng: Generator) -> Mesh:
    """An open sheet of random hills."""
    x, y = np.meshgrid(np.linspace(-1, 1, 24), np.linspace(-1, 1, 24))
    waves = rng.normal(size=(6, 2)) * 3
    phases = rng.uniform(0, 2 * np.pi, 6)
    z = 0.12 * sum(np.sin(w[0] * x + w[1] * y + p) for w, p in zip(waves, phases, strict=True))
    points = np.stack([x, y, z], axis=-1).reshape(-1, 3)
    corner = np.arange(23)[:, None] * 24 + np.arange(23)
    a, b, c, d = (corner + step for step in (0, 1, 25, 24))
    faces = np.concatenate([np.stack(f, -1).reshape(-1, 3) for f in ((a, b, c), (a, c, d))])
    return Mesh(points, faces)


def rubble(rng: Generator) -> Mesh:
    """Loose boxes in a heap."""
    boxes = []
    for _ in range(int(rng.integers(3, 9))):
        box = trimesh.creation.box(extents=rng.uniform(0.2, 1, 3))
        place = np.eye(4)
        place[:3, :3], place[:3, 3] = random_rotation(rng), rng.uniform(-0.8, 0.8, 3)
        box.apply_transform(place)
        boxes.append(_plain(box))
    offsets = np.cumsum([0, *(len(box.vertices) for box in boxes[:-1])])
    return Mesh(
        np.concatenate([box.vertices for box in boxes]),
        np.concatenate([box.faces + offset for box, offset in zip(boxes, offsets, strict=True)]),
    )


def crumple(rng: Generator) -> Mesh:
    """A ball whose every vertex is moved at random: noise, with faces."""
    ball = trimesh.creation.icosphere(subdivisions=3)
    return Mesh(
        ball.vertices + rng.normal(0, rng.uniform(0.1, 0.3), ball.vertices.shape), ball.faces
    )


KINDS: tuple[Callable[[Generator], Mesh], ...] = (
    *(cuboid, prism, cone, ring, pipe, hull, superquadric),
    *(blob, urchin, knot, spring, terrain, rubble, crumple),
)


def make_shapes(of_each: int, seed: int) -> Iterator[Mesh]:
    """`of_each` random shapes of every kind."""
    for number, kind in enumerate(KINDS):
        for copy in range(of_each):
            yield kind(np.random.default_rng([seed, number, copy]))


def _tube(path: np.ndarray, radius: float, sides: int = 8) -> Mesh:
    """A round tube along a polyline, P x 3, closed by a fan at each end."""
    forward = np.gradient(path, axis=0)
    forward /= np.linalg.norm(forward, axis=1, keepdims=True)
    aside = np.cross(forward, [0, 0, 1.0])
    aside /= np.linalg.norm(aside, axis=1, keepdims=True)
    up = np.cross(aside, forward)
    angle = np.linspace(0, 2 * np.pi, sides, endpoint=False)[:, None, None]
    rings = path + radius * (np.cos(angle) * aside + np.sin(angle) * up)  # sides x P x 3
    points = np.concatenate([rings.transpose(1, 0, 2).reshape(-1, 3), path[[0, -1]]])
    start = np.arange(len(path) - 1)[:, None] * sides
    one, other = start + np.arange(sides), start + (np.arange(sides) + 1) % sides
    quads = ((one, other, other + sides), (one, other + sides, one + sides))
    faces = [np.stack(f, -1).reshape(-1, 3) for f in quads]
    last = (len(path) - 1) * sides
    edge = np.arange(sides)
    following = (edge + 1) % sides
    caps = (
        (np.full(sides, len(points) - 2), following, edge),
        (np.full(sides, len(points) - 1), last + edge, last + following),
    )
    return Mesh(points, np.concatenate([*faces, *(np.stack(f, -1) for f in caps)]))


def _plain(mesh: trimesh.Trimesh) -> Mesh:
    return Mesh(np.asarray(mesh.vertices), np.asarray(mesh.faces))
