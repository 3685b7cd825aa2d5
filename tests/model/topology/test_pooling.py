"""Pooling against the paper's steps, done by merging the corners of each chosen face."""

from collections import defaultdict

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from meshconv3d.model.topology.halfedges import find_twins
from meshconv3d.model.topology.pooling import SLACK, pool_faces
from tests.meshes import sheet
from tests.surfaces import triangles


class NotSimple(Exception):
    """Merging corners would glue the surface together where it only comes close."""


def faces_by_edge(faces: dict[int, tuple]) -> dict[frozenset, list[int]]:
    edges = defaultdict(list)
    for f, (a, b, c) in faces.items():
        for edge in ((a, b), (b, c), (c, a)):
            edges[frozenset(edge)].append(f)
    return edges


def neighbours_by_dictionary(faces: dict[int, tuple]) -> dict[int, set[int]]:
    near = {f: set() for f in faces}
    for one, *others in faces_by_edge(faces).values():
        if len(others) != 1:
            raise NotSimple
        near[one].add(others[0])
        near[others[0]].add(one)
    return near


def merge_corners(faces: dict[int, tuple], centre: int) -> dict[int, tuple]:
    """Merge the corners of a face; drop what degenerates, and pairs left lying on each other."""
    around = defaultdict(set)
    for face in faces.values():
        for v in face:
            around[v] |= {*face} - {v}
    known = {frozenset(face) for face in faces.values()}
    a, b, c = faces[centre]
    for v, w in ((a, b), (b, c), (c, a)):
        # A vertex next to both ends comes to lie on itself. That is sound where faces fill the
        # triangle between: at the edge's own two faces, and fanning out from there.
        common = around[v] & around[w]
        filled = {u for u in common if {v, w, u} in known}
        while more := {
            u
            for u in common - filled
            if any({v, t, u} in known and {w, t, u} in known for t in filled)
        }:
            filled |= more
        if common != filled:
            raise NotSimple
    merged = {f: tuple(a if v in (a, b, c) else v for v in face) for f, face in faces.items()}
    lying = defaultdict(list)
    for f, face in merged.items():
        if len({*face}) == 3:
            lying[frozenset(face)].append(f)
    if any(len(pile) > 2 for pile in lying.values()):
        raise NotSimple
    return {f: merged[f] for pile in lying.values() if len(pile) == 1 for f in pile}


def average(rows: list[dict[int, float]]) -> dict[int, float]:
    """The mean of features that are themselves weighted sums, as {face: share}."""
    mean = defaultdict(float)
    for row in rows:
        for m, share in row.items():
            mean[m] += share / len(rows)
    return dict(mean)


def pool_by_the_paper(
    faces: dict[int, tuple], features, target, squared, literal
) -> tuple[dict, dict]:
    """Steps 1 to 6, one face after the other.

    Returns {survivor: {face that it gathers: its share}} and {survivor: its neighbours}.
    """
    members = {f: {f: 1.0} for f in faces}
    while len(faces) > target:
        near = neighbours_by_dictionary(faces)
        mean = {f: sum(w * features[m] for m, w in members[f].items()) for f in faces}
        power = 2 if squared else 1
        weight = {
            f: sum(np.linalg.norm(mean[f] - mean[n]) ** power for n in near[f]) for f in faces
        }
        marked: set[int] = set()
        left, gathered = faces, dict(members)
        for f in sorted(faces, key=lambda f: (weight[f], f)):
            if len(left) <= target:
                break
            gone = {f} | near[f]
            region = gone.union(*(near[n] for n in gone))
            if region & marked or region == gone:
                continue
            trial = merge_corners(left, f)
            if not trial or len(trial) < target - SLACK:
                continue
            before, after = neighbours_by_dictionary(left), neighbours_by_dictionary(trial)
            touched = region - gone
            region |= {g for g in left if before[g] != after.get(g)}
            marked |= region
            if literal:
                for g in region & trial.keys():
                    gathered[g] = average([members[n] for n in near[g] & region])
            else:
                for g in touched:
                    union = {*members[g]}.union(*(members[n] for n in near[g] & gone))
                    gathered[g] = dict.fromkeys(union, 1 / len(union))
            left = trial
        if left is faces:
            break
        faces, members = left, gathered
    return {f: members[f] for f in faces}, neighbours_by_dictionary(faces)


def pool_by_kernel(faces, features, target, squared, literal) -> tuple[dict, dict]:
    """The same two dictionaries from the half-edge kernel."""
    twin, _, _ = find_twins(faces, int(faces.max()) + 1)
    kept, twin, index, shares = pool_faces(twin, features, target, squared, literal)
    members, near = {}, {}
    for row, f in enumerate(kept.tolist()):
        named = index[row] > 0
        assert (shares[row, ~named] == 0).all()
        members[f] = dict(zip((index[row, named] - 1).tolist(), shares[row, named], strict=True))
        near[f] = {int(kept[t // 3]) for t in twin[3 * row : 3 * row + 3]}
    return members, near


@given(
    triangles(kinds=("fine",), most=240),
    st.integers(0, 2**32 - 1),
    st.floats(0.4, 1),
    st.booleans(),
    st.booleans(),
)
def test_pooling_is_the_papers_selection_and_merges_corners(surface, seed, share, squared, literal):
    faces = surface.faces
    features = np.random.default_rng(seed).random((len(faces), 3))
    target = round(share * len(faces))
    try:
        expected, neighbours = pool_by_the_paper(
            dict(enumerate(faces.tolist())), features, target, squared, literal
        )
    except NotSimple:
        assume(False)
        raise
    found, found_neighbours = pool_by_kernel(faces, features, target, squared, literal)
    assert found_neighbours == neighbours
    assert found.keys() == expected.keys()
    for f, row in expected.items():
        assert found[f] == pytest.approx(row)


@pytest.mark.parametrize("literal", [False, True])
def test_the_first_face_to_collapse_is_most_like_the_neighbours_it_has(literal):
    faces = sheet(6, 6).faces
    twin, _, _ = find_twins(faces, int(faces.max()) + 1)
    near = [[t // 3 for t in row if t >= 0] for row in twin.reshape(-1, 3)]
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
        kept, _, _, _ = pool_faces(twin, features, len(faces) - 1, True, literal)
        lightest = int(np.argmin(weights))
        at_border.add(len(near[lightest]) < 3)
        assert {*each} - {*kept} >= {lightest, *near[lightest]}
    assert at_border == {True, False}
