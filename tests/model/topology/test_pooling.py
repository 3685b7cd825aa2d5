"""Pooling against the paper's steps, done on sets of corners; and the topology that it keeps."""

from collections import Counter, defaultdict

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from meshconv3d.model.topology.halfedges import find_twins
from meshconv3d.model.topology.pooling import pool_faces
from tests.meshes import sheet
from tests.surfaces import MANIFOLD, TETRAHEDRON, sides_of, triangles

Faces = dict[int, tuple[int, ...]]
Shares = dict[int, float]  # of each face that is gathered
SEEDS = st.integers(0, 2**32 - 1)
OUTSIDE = -1


def faces_by_edge(faces: Faces) -> dict[frozenset, list[int]]:
    edges = defaultdict(list)
    for f, face in faces.items():
        for edge in sides_of(face):
            edges[frozenset(edge)].append(f)
    return edges


def neighbours_of(faces: Faces) -> dict[int, set[int]]:
    near = {f: set() for f in faces}
    for sides in faces_by_edge(faces).values():
        for f in sides:
            near[f] |= {*sides} - {f}
    return near


def close(faces: Faces) -> list[frozenset]:
    """The faces, and a triangle from every edge of a border to the vertex outside."""
    borders = [edge for edge, sides in faces_by_edge(faces).items() if len(sides) == 1]
    return [frozenset(face) for face in faces.values()] + [edge | {OUTSIDE} for edge in borders]


def is_disc(faces: Faces, centre: int) -> bool:
    """Whether the faces around the corners of a face make a disc of three sides or more."""
    corners = {*faces[centre]}
    around = [face for face in close(faces) if face & corners]
    edges = {frozenset(edge) for face in around for edge in sides_of(tuple(face))}
    vertices = frozenset().union(*around)
    rim = [edge for edge in edges if not edge & corners]
    if len(vertices) - len(edges) + len(around) != 1 or len(rim) < 3:
        return False
    # The rim is one closed line that meets no vertex twice.
    if any(sum(v in edge for edge in rim) != 2 for v in frozenset().union(*rim)):
        return False
    reached = {min(rim[0])}
    for _ in rim:
        reached = reached.union(*(edge for edge in rim if edge & reached))
    return reached == frozenset().union(*rim)


def joined(edges: set[frozenset], one: tuple, other: tuple) -> bool:
    """Whether two faces have a corner in common, or an edge between their corners."""
    return any(v == w or frozenset((v, w)) in edges for v in one for w in other)


def mean_of(rows: list[Shares]) -> Shares:
    """The mean of features that are themselves weighted sums, as {face: share}."""
    mean: Shares = defaultdict(float)
    for row in rows:
        for m, share in row.items():
            mean[m] += share / len(rows)
    return mean


def shares_of(gathered: Counter[int]) -> Shares:
    """The share of each face in the mean over all that was gathered, as often as it was."""
    return {m: count / gathered.total() for m, count in gathered.items()}


def pool_by_the_paper(faces: Faces, features, target, squared, literal) -> tuple[dict, dict]:
    """Steps 1 to 6, one face after the other.

    Returns {survivor: {face that it gathers: its share}} and {survivor: its neighbours}.
    """
    counts = {f: Counter([f]) for f in faces}
    shares: dict[int, Shares] = {f: {f: 1.0} for f in faces}
    while len(faces) > target:
        near = neighbours_of(faces)
        mean = {f: sum(w * features[m] for m, w in shares[f].items()) for f in faces}
        weight = {}
        for f in faces:
            others = [mean[n] for n in near[f]]
            if literal:
                others += [0 * mean[f]] * (3 - len(others))
            distances = [np.linalg.norm(mean[f] - other) for other in others]
            total = sum(d**2 if squared else d for d in distances)
            weight[f] = np.float32(total * 3 / max(len(others), 1))
        edges = {*faces_by_edge(faces)}
        chosen, left = [], len(faces)
        for f in sorted(faces, key=lambda f: (weight[f], f)):
            if left <= target:
                break
            if not any(joined(edges, faces[f], faces[g]) for g in chosen) and is_disc(faces, f):
                chosen.append(f)
                left -= 1 + len(near[f])
        if not chosen:
            break
        region = {f: {f} | near[f] for f in chosen}
        gone = set().union(*region.values())
        region = {f: part.union(*(near[n] for n in part)) for f, part in region.items()}
        counts_after, shares_after = {}, {}
        for g in faces.keys() - gone:
            sources = [g, *(near[g] & gone)]
            counts_after[g] = sum((counts[source] for source in sources), Counter())
            shares_after[g] = shares_of(counts_after[g])
            if literal and len(sources) == 1:
                shares_after[g] = shares[g]
            elif literal:
                touched = [part for part in region.values() if g in part and part & near[g] & gone]
                neighbours = [n for n in near[g] if any(n in part for part in touched)]
                shares_after[g] = mean_of([shares[n] for n in neighbours])
        merged = {v: faces[f][0] for f in chosen for v in faces[f]}
        faces = {
            f: tuple(merged.get(v, v) for v in face) for f, face in faces.items() if f not in gone
        }
        counts, shares = counts_after, shares_after
    return shares, neighbours_of(faces)


def pool_by_kernel(faces, features, target, squared, literal) -> tuple[dict, dict]:
    """The same two dictionaries from the kernel."""
    twin, _, _ = find_twins(faces, int(faces.max()) + 1)
    pooled = pool_faces(faces, twin, features, target, squared, literal)
    kept = pooled.kept.tolist()
    shares, near = {}, {}
    for row, f in enumerate(kept):
        shares[f] = defaultdict(float)
        for entry, share in zip(pooled.index[row], pooled.shares[row], strict=True):
            assert (entry > 0) == (share > 0)
            if entry:
                shares[f][entry - 1] += share
        near[f] = {kept[t // 3] for t in pooled.twin[3 * row : 3 * row + 3] if t >= 0}
    return shares, near


@given(
    triangles(kinds=MANIFOLD, most=80),
    SEEDS,
    st.floats(0.1, 1),
    st.booleans(),
    st.booleans(),
)
def test_pooling_is_the_papers_selection_and_merges_corners(surface, seed, share, squared, literal):
    faces = surface.faces
    features = np.random.default_rng(seed).random((len(faces), 3))
    arguments = features, round(share * len(faces)), squared, literal
    numbered = {f: (a, b, c) for f, (a, b, c) in enumerate(faces.tolist())}
    expected, neighbours = pool_by_the_paper(numbered, *arguments)
    found, found_neighbours = pool_by_kernel(faces, *arguments)
    assert found_neighbours == neighbours
    assert found.keys() == expected.keys()
    for f, row in expected.items():
        assert found[f] == pytest.approx(row)


@given(triangles(kinds=MANIFOLD, most=40))
def test_equal_weights_collapse_in_the_order_of_the_faces(surface):
    faces = surface.faces
    arguments = np.zeros((len(faces), 1)), 1, True, False
    numbered = {f: (a, b, c) for f, (a, b, c) in enumerate(faces.tolist())}
    assert pool_by_kernel(faces, *arguments)[1] == pool_by_the_paper(numbered, *arguments)[1]


@pytest.mark.parametrize(
    "faces",
    [
        [(0, 1, 2)],
        [(0, 1, 2), (2, 1, 3)],
        TETRAHEDRON,
        # A triangle and a tetrahedron with one more vertex in a face.
        [(0, 1, 3), (1, 2, 3), (2, 0, 3)],
        [*TETRAHEDRON[:3], (1, 3, 4), (3, 2, 4), (2, 1, 4)],
        # A prism without ends.
        [(0, 1, 3), (1, 4, 3), (1, 2, 4), (2, 5, 4), (2, 0, 5), (0, 3, 5)],
    ],
)
def test_what_is_as_small_as_its_topology_allows_stays(faces):
    faces = np.array(faces, np.int32)
    twin, _, _ = find_twins(faces, 6)
    pooled = pool_faces(faces, twin, np.zeros((len(faces), 1)), 1, True, False)
    assert pooled.faces.tolist() == faces.tolist()


def test_an_octahedron_becomes_a_tetrahedron():
    faces = [(0, 2, 4), (2, 1, 4), (1, 3, 4), (3, 0, 4), (2, 0, 5), (1, 2, 5), (3, 1, 5), (0, 3, 5)]
    faces = np.array(faces, np.int32)
    twin, _, _ = find_twins(faces, 6)
    pooled = pool_faces(faces, twin, np.zeros((8, 1)), 7, True, False)
    # The corners 0, 2 and 4 of the first face are one now.
    corners = {frozenset(face) for face in pooled.faces.tolist()}
    assert corners == {frozenset(face) for face in [(0, 1, 3), (0, 1, 5), (0, 3, 5), (1, 3, 5)]}
    # Each survivor gathers itself and the one or more faces that went from beside it.
    for row, f in enumerate(pooled.kept.tolist()):
        beside = {t // 3 for t in twin[3 * f : 3 * f + 3].tolist()}
        gathered = {entry - 1 for entry in pooled.index[row].tolist() if entry}
        assert gathered == {f} | (beside - {*pooled.kept.tolist()})


@pytest.mark.parametrize("literal", [False, True])
def test_the_first_face_to_collapse_is_most_like_the_neighbours_it_has(literal):
    faces = sheet(6, 6).faces
    twin, _, _ = find_twins(faces, int(faces.max()) + 1)
    near = [[t // 3 for t in row if t >= 0] for row in twin.reshape(-1, 3)]
    numbered = {f: (a, b, c) for f, (a, b, c) in enumerate(faces.tolist())}
    may = np.array([is_disc(numbered, f) for f in numbered])
    at_border, each = set(), range(len(faces))
    for seed in range(200 if literal else 60):
        features = np.random.default_rng(seed).random((len(faces), 2))
        distances = [[np.sum((features[f] - features[n]) ** 2) for n in near[f]] for f in each]
        if literal:
            # A missing neighbour is the zero vector.
            missing = [(3 - len(near[f])) * np.sum(features[f] ** 2) for f in each]
            weights = np.array(missing) + [sum(row) for row in distances]
        else:
            # A missing neighbour counts as the mean of the others.
            weights = np.array([np.mean(row) for row in distances])
        lightest = int(np.where(may, weights, np.inf).argmin())
        at_border.add(len(near[lightest]) < 3)
        pooled = pool_faces(faces, twin, features, len(faces) - 1, True, literal)
        assert {*each} - {*pooled.kept.tolist()} == {lightest, *near[lightest]}
    assert at_border == {True, False}
