"""Pooling by face collapse, with the result of `model.topology.pooling`, face by face.

The kernel takes the faces of a pass one after the other. Here all are asked at once, in rounds: a
candidate is chosen if it comes before all other candidates near it, and then these are candidates
no more. That chooses the same faces, as the choice of a face depends only on those near it that
come before. Two faces are near if a corner of one is a corner of the other, or next to one.
"""

from typing import NamedTuple

import numpy as np

from meshconv3d.export.whole.arrays import (
    BOOL,
    DOUBLE,
    INT,
    REAL,
    Array,
    any_over,
    arange,
    argmax,
    broadcast,
    concatenate,
    constant,
    count_over,
    cumulative_sum,
    expand,
    full,
    loop,
    max_over,
    maximum,
    min_over,
    nonzero,
    scatter,
    sort,
    sqrt,
    sum_in_order,
    sum_over,
    take,
    where,
)
from meshconv3d.export.whole.halfedges import half_edges


class PooledFaces(NamedTuple):
    """As in `model.topology.pooling`, int64: kept, F'; faces, F' x 3; twin, 3 F'; index, F' x W."""

    kept: Array
    faces: Array
    twin: Array
    index: Array


class Living:
    """The surface in a pass: the faces that are alive, among the F of its level.

    faces: F x 3. twin: H. alive: F booleans; of other faces, corners and twins have no meaning.
    vertex_count: a number; the vertex of this number is the outside of the surface.
    """

    def __init__(self, faces: Array, twin: Array, alive: Array, vertex_count: Array) -> None:
        self.faces, self.twin, self.alive = faces, twin, alive
        self.outside = vertex_count
        self.beside = (twin >= 0).reshape(-1, 3)
        self._neighbours = (maximum(twin, 0) // 3).reshape(-1, 3)
        starts, ends = half_edges(faces)
        live = self.of_corners(alive)
        border = live & (twin < 0)
        # The kernel's pairs of a vertex and one next to it. Edges that are gone lead nowhere.
        size = vertex_count + 1
        pairs = concatenate(
            [starts * size + ends, ends * size + starts, starts * size + vertex_count], 0
        )
        there = concatenate([live, border, border], 0).astype(REAL)
        edges = scatter(full(0, REAL, size * size), pairs, there, join="add")
        self._edges = edges.reshape(size, size)
        starts, ends = where(live, starts, vertex_count), where(live, ends, vertex_count)
        self._from = concatenate([starts, ends], 0)
        self._to = concatenate([ends, starts], 0)

    def of_corners(self, values: Array) -> Array:
        """A value for each face (F), three times: H."""
        return broadcast(expand(values, 1), self.faces.size(), 3).reshape(-1)

    def of_neighbours(self, values: Array) -> Array:
        """Rows of a table by face (F x ...) for the neighbours of each face: F x 3 x ..., with any
        rows where `beside` is false."""
        return values[self._neighbours]

    def may_collapse(self) -> Array:
        """Whether the faces around the corners of each face make a disc: F booleans.

        The kernel's rule: the corners have six edges more than they have neighbours. Numbers are
        float32, in which they are exact.
        """
        one, two, three = ((self._edges > 0)[take(self.faces, s, axis=1)] for s in range(3))
        vertices = sum_over((one | two | three).astype(REAL), 1)
        edges = sum_over(sum_over(self._edges, 1)[self.faces], 1)
        return self.alive & (edges == vertices + 6) & (vertices >= 6)

    def least_near(self, values: Array, most: Array) -> Array:
        """The least of the values (F) of the faces near each face: F. most: none is greater."""
        corners = self.faces.reshape(-1)
        least = scatter(
            broadcast(most, self.outside + 1), corners, self.of_corners(values), join="min"
        )
        least = scatter(least, self._from, least[self._to], join="min")
        return min_over(least[self.faces], 1)


def pool_faces(
    faces: Array, twin: Array, features: Array, vertex_count: Array, target: int, squared: bool
) -> PooledFaces:
    """Collapse faces until `target` are left, or as few as the topology of the surface allows.

    faces: F x 3. twin: H. features: F x C float32, what equation 5 compares, by squared or plain
    Euclidean distance.
    """
    count = faces.size()

    def one_pass(faces: Array, twin: Array, alive: Array, index: Array) -> tuple[Array, ...]:
        surface = Living(faces, twin, alive, vertex_count)
        weights = _weigh(surface, _average(features, index), squared)
        centres = _choose(surface, weights, target)
        gone = centres | any_over(surface.beside & surface.of_neighbours(centres), 1)
        survivors = alive & ~gone
        left = count_over(survivors, 0)
        return (
            (left > target) & (left < count_over(alive, 0)),
            *_merge(surface, centres, gone),
            survivors,
            _gather(surface, survivors, gone, index),
        )

    itself = expand(arange(count, start=1), 1)
    state = faces, twin, full(True, BOOL, count), itself
    return _compact(*loop(count > target, one_pass, state))


def gather_mean(features: Array, index: Array) -> Array:
    """Mean of the rows (F x C float32) that each row of a null-padded index (F' x W) names."""
    present = count_over(index > 0, 1, keepdims=True).astype(REAL)
    return sum_in_order(_with_null_row(features)[index], 1) / present


def _with_null_row(table: Array) -> Array:
    """By face + 1, with zeros for the null face: F x C -> (F + 1) x C."""
    return concatenate([full(0, table.dtype, 1, table.size(1)), table], 0)


def _average(features: Array, index: Array) -> Array:
    """The features of the faces by what each has gathered: F x C float64."""
    present = maximum(count_over(index > 0, 1, keepdims=True), 1)
    share = expand(1.0 / present.astype(DOUBLE), 2)
    return sum_in_order(_with_null_row(features.astype(DOUBLE))[index] * share, 1)


def _weigh(surface: Living, features: Array, squared: bool) -> Array:
    """Equation 5, F float32: summed feature distance to the three neighbours."""
    difference = expand(features, 1) - surface.of_neighbours(features)
    distance = sum_in_order(difference * difference, 2)
    if not squared:
        distance = sqrt(distance)
    total = sum_in_order(where(surface.beside, distance, 0.0), 1)
    present = maximum(count_over(surface.beside, 1), 1)
    return (total * 3.0 / present.astype(DOUBLE)).astype(REAL)


def _choose(surface: Living, weights: Array, target: int) -> Array:
    """The faces to collapse, by ascending weight, until `target` would be left: F booleans."""
    count = surface.faces.size()
    _, order = sort(where(surface.alive, weights, np.inf), count)
    rank = scatter(order, order, arange(count))

    def one_round(candidates: Array, chosen: Array) -> tuple[Array, ...]:
        first = surface.least_near(where(candidates, rank, count), count)
        picked = candidates & (rank == first)
        candidates = candidates & (surface.least_near(where(picked, 0, 1), constant(1)) > 0)
        return any_over(candidates), candidates, chosen | picked

    candidates = surface.may_collapse()
    state = candidates, full(False, BOOL, count)
    _, chosen = loop(any_over(candidates), one_round, state)
    # Faces that go with each in its order, and those that are left before it.
    going = where(chosen, count_over(surface.beside, 1) + 1, 0)[order]
    left = count_over(surface.alive, 0) - (cumulative_sum(going) - going)
    return chosen & (left[rank] > target)


def _gather(surface: Living, survivors: Array, gone: Array, index: Array) -> Array:
    """What each face has gathered after the pass: F x W, nothing where it has not survived."""
    taken = expand(surface.beside & surface.of_neighbours(gone), 2)
    rows = where(taken, surface.of_neighbours(index), 0)
    rows = concatenate([index, *(take(rows, s, axis=1) for s in range(3))], 1)
    rows = where(expand(survivors, 1), rows, 0)
    # Without gaps.
    present = rows > 0
    places = cumulative_sum(present.astype(INT), axis=1)
    width = max_over(places)
    empty = full(0, INT, rows.size(), width)
    return scatter(empty, where(present, places - 1, 0), rows, axis=1, join="add")


def _merge(surface: Living, centres: Array, gone: Array) -> tuple[Array, Array]:
    """Merge the corners of collapsed faces, and pair the faces beyond those that go."""
    corners = surface.faces.reshape(-1)
    first = where(centres, take(surface.faces, 0, axis=1), -1)
    merged = scatter(full(-1, INT, surface.outside), corners, surface.of_corners(first), join="max")
    merged = where(merged >= 0, merged, arange(surface.outside))
    # Across a face that goes: from one of its outer sides to what is beyond the other.
    inner = argmax((surface.beside & surface.of_neighbours(centres)).astype(REAL), 1)
    sides = constant([[0, 1, 2]])
    outer = (constant(6) - inner - sides) % 3
    count = surface.faces.size()
    twin = surface.twin
    beyond = twin[(expand(arange(count), 1) * 3 + outer).reshape(-1)]

    def hop(twin: Array) -> Array:
        over = maximum(twin, 0)
        return where((twin >= 0) & gone[over // 3], beyond[over], twin)

    # Two neighbours of a collapsed face may share an edge; all three would have no other.
    return merged[surface.faces], hop(hop(twin))


def _compact(faces: Array, twin: Array, alive: Array, index: Array) -> PooledFaces:
    """Number the living faces 0 to F' - 1."""
    kept = nonzero(alive)
    number = cumulative_sum(alive.astype(INT)) - 1
    twin = twin.reshape(-1, 3)[kept].reshape(-1)
    over = maximum(twin, 0)
    twin = where(twin >= 0, number[over // 3] * 3 + over % 3, -1)
    return PooledFaces(kept, faces[kept], twin, index[kept])
