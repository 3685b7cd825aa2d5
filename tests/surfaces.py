"""Hypothesis strategies for the triangles of every kind of surface that topology must bear."""

from dataclasses import dataclass

import numpy as np
from hypothesis import strategies as st
from numpy.typing import NDArray

from meshconv3d.model.mesh import Mesh
from meshconv3d.model.preparation.cleaning import split_vertices
from meshconv3d.model.topology.halfedges import find_twins
from tests.meshes import torus

TETRAHEDRON = [(0, 1, 2), (0, 2, 3), (0, 3, 1), (1, 3, 2)]


@dataclass(frozen=True, eq=False)
class Triangles:
    """Faces (F x 3 int32, none degenerate, none twice) and what kind of surface they make."""

    kind: str
    faces: NDArray[np.int32]

    @property
    def vertex_count(self) -> int:
        return int(self.faces.max()) + 1

    def mesh(self, seed: int = 0) -> Mesh:
        """The triangles over random vertices, so that no two lengths are the same."""
        return Mesh(np.random.default_rng(seed).normal(size=(self.vertex_count, 3)), self.faces)


def closed_surface(
    rng: np.random.Generator, handles: int, face_count: int, flips: float
) -> NDArray[np.int32]:
    """A connected, closed, oriented surface of at least `face_count` faces.

    handles: its genus. flips: edge flips for each vertex that is added; with 0 most vertices
    have three faces, with many the surface is well mixed.
    """
    faces = list(TETRAHEDRON)
    for _ in range(handles):
        faces = _connected_sum(faces, [tuple(face) for face in torus(3, 3).faces.tolist()])
    vertex_count = max(max(face) for face in faces) + 1
    owner = {edge: i for i, face in enumerate(faces) for edge in sides_of(face)}

    def put(i: int, face: tuple[int, int, int]) -> None:
        faces[i : i + 1] = [face]
        owner.update(dict.fromkeys(sides_of(face), i))

    while len(faces) < face_count:
        i = int(rng.integers(len(faces)))
        a, b, c = faces[i]
        put(i, (a, b, vertex_count))
        put(len(faces), (b, c, vertex_count))
        put(len(faces), (c, a, vertex_count))
        vertex_count += 1
        for _ in range(rng.poisson(flips)):
            i, s = int(rng.integers(len(faces))), int(rng.integers(3))
            a, b, c = faces[i][s], faces[i][(s + 1) % 3], faces[i][(s + 2) % 3]
            j = owner[b, a]
            d = next(v for v in faces[j] if v not in (a, b))
            if (c, d) not in owner and (d, c) not in owner and c != d:
                del owner[a, b], owner[b, a]
                put(i, (a, d, c))
                put(j, (d, b, c))
    return np.array(faces, np.int32)


def sides_of(face: tuple[int, ...]) -> list[tuple[int, int]]:
    a, b, c = face
    return [(a, b), (b, c), (c, a)]


def _connected_sum(one: list[tuple[int, ...]], two: list[tuple[int, ...]]) -> list:
    start = max(max(face) for face in one) + 1
    (a, b, c), (d, e, f) = one[-1], two[-1]
    name = {d: a, e: c, f: b}
    return one[:-1] + [tuple(name.get(v, v + start) for v in face) for face in two[:-1]]


def in_four(faces: NDArray[np.int32]) -> NDArray[np.int32]:
    """Every face cut into four at the middles of its sides: nothing is narrow any more."""
    edges = np.sort(np.stack([faces, np.roll(faces, -1, axis=1)], -1).reshape(-1, 2), axis=1)
    _, middle = np.unique(edges, axis=0, return_inverse=True)
    (a, b, c), (d, e, f) = faces.T, (middle.reshape(-1, 3) + faces.max() + 1).T
    cut = [(a, d, f), (d, b, e), (f, e, c), (d, e, f)]
    return np.concatenate([np.stack(face, axis=-1) for face in cut]).astype(np.int32)


def _without_some(rng: np.random.Generator, faces: NDArray[np.int32]) -> NDArray[np.int32]:
    kept = rng.random(len(faces)) < rng.uniform(0.5, 1)
    kept[rng.integers(len(faces))] = True
    return faces[kept]


def _one_fan_each(faces: NDArray[np.int32]) -> NDArray[np.int32]:
    """The faces with a vertex of its own for every fan: surfaces that touch in a corner part."""
    twin, _, _ = find_twins(faces.astype(np.int32), int(faces.max()) + 1)
    return split_vertices(np.zeros((faces.max() + 1, 3)), faces, twin)[1]


def _any_triples(rng: np.random.Generator, face_count: int) -> NDArray[np.int32]:
    triples = rng.integers(0, rng.integers(3, 14), (face_count, 3))
    unique = {tuple(sorted(t)): t for t in triples.tolist() if len(set(t)) == 3}
    return np.array([*unique.values()] or [(0, 1, 2)], np.int32)


def _side_by_side(parts: list[NDArray[np.int32]]) -> NDArray[np.int32]:
    starts = np.cumsum([0, *(part.max() + 1 for part in parts)])
    return np.concatenate([part + start for part, start in zip(parts, starts, strict=False)])


MANIFOLD = ("closed", "fine", "bordered", "single", "components")
EVERY_KIND = (*MANIFOLD, "non-manifold")


@st.composite
def triangles(draw: st.DrawFn, kinds: tuple[str, ...] = EVERY_KIND, most: int = 80) -> Triangles:
    """Surfaces of 1 to about `most` faces, renumbered, in any order, with any corner first."""
    kind = draw(st.sampled_from(kinds))
    rng = np.random.default_rng(draw(st.integers(0, 2**32 - 1)))
    handles, flips = draw(st.integers(0, 2)), draw(st.sampled_from([0, 1, 5]))
    size = draw(st.integers(1, most))
    if kind == "single":
        faces = np.array([[0, 1, 2]])
    elif kind == "closed":
        faces = closed_surface(rng, handles, size, flips)
    elif kind == "fine":
        faces = in_four(closed_surface(rng, handles, size // 4, flips))
    elif kind == "bordered":
        faces = _without_some(rng, closed_surface(rng, handles, size, flips))
    elif kind == "components":
        count = draw(st.integers(2, 6))
        parts = [closed_surface(rng, 0, max(4, size // count), flips) for _ in range(count)]
        parts = [_without_some(rng, part) if rng.random() < 0.5 else part for part in parts]
        faces = _side_by_side(parts)
    else:
        faces = _any_triples(rng, size)
    if kind != "non-manifold":
        faces = _one_fan_each(faces)
    used, corners = np.unique(faces, return_inverse=True)
    faces = rng.permutation(len(used))[corners].reshape(faces.shape)[rng.permutation(len(faces))]
    turns = rng.integers(0, 3, (len(faces), 1))
    faces = np.take_along_axis(faces, (np.arange(3) + turns) % 3, axis=1)
    return Triangles(kind, faces.astype(np.int32))
