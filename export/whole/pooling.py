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
    """As in `model.topology.pooling`: kept, F'; faces, F' x 3; twin, 3 F'; index, F' x W; int64;
    shares, F' x W float64."""

    kept: Array
    faces: Array
    twin: Array
    index: Array
    shares: Array


class Living:
    """The surface in a pass: the faces that are alive, among the F of its level.

    faces: F x 3. twin: H. alive: F booleans; of other faces, corners and twins have no meaning.
    vertex_count: a number; the vertex of this number is the outside of the surface.
    """

    def __init__(self, faces: Array, twin: Array, alive: Array, vertex_count: Array) -> None:
        self.faces, self.twin, self.alive = faces, twin, alive
        self.outside = vertex_count
        self.beside = (twin >= 0).reshape(-1, 3)
        self.neighbours = (maximum(twin, 0) // 3).reshape(-1, 3)
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
        return values[self.neighbours]

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
    faces: Array,
    twin: Array,
    features: Array,
    vertex_count: Array,
    target: int,
    squared: bool,
    literal: bool,
) -> PooledFaces:
    """Collapse faces until `target` are left, or as few as the topology of the surface allows.

    faces: F x 3. twin: H. features: F x C float32, what equation 5 compares, by squared or plain
    Euclidean distance. literal: see the kernel.
    """
    count = faces.size()

    def one_pass(
        faces: Array, twin: Array, alive: Array, index: Array, shares: Array
    ) -> tuple[Array, ...]:
        surface = Living(faces, twin, alive, vertex_count)
        weights = _weigh(surface, _average(features, index, shares), squared, literal)
        centres = _choose(surface, weights, target)
        gone = centres | any_over(surface.beside & surface.of_neighbours(centres), 1)
        survivors = alive & ~gone
        left = count_over(survivors, 0)
        return (
            (left > target) & (left < count_over(alive, 0)),
            *_merge(surface, centres, gone),
            survivors,
            *_gather(surface, centres, gone, index, shares, literal),
        )

    itself = expand(arange(count, start=1), 1)
    state = faces, twin, full(True, BOOL, count), itself, full(1, DOUBLE, count, 1)
    return _compact(*loop(count > target, one_pass, state))


def gather_mean(features: Array, index: Array) -> Array:
    """Mean of the rows (F x C float32) that each row of a null-padded index (F' x W) names."""
    present = count_over(index > 0, 1, keepdims=True).astype(REAL)
    return sum_in_order(_with_null_row(features)[index], 1) / present


def _with_null_row(table: Array) -> Array:
    """By face + 1, with zeros for the null face: F x C -> (F + 1) x C."""
    return concatenate([full(0, table.dtype, 1, table.size(1)), table], 0)


def _average(features: Array, index: Array, shares: Array) -> Array:
    """The features of the faces by what each has gathered: F x C float64."""
    rows = _with_null_row(features.astype(DOUBLE))[index]
    return sum_in_order(rows * expand(shares, 2), 1)


def _weigh(surface: Living, features: Array, squared: bool, literal: bool) -> Array:
    """Equation 5, F float32: summed feature distance to the three neighbours."""
    beside = surface.beside
    others = where(expand(beside, 2), surface.of_neighbours(features), 0.0)
    difference = expand(features, 1) - others
    distance = sum_in_order(difference * difference, 2)
    if not squared:
        distance = sqrt(distance)
    present = constant(3)
    if not literal:
        distance = where(beside, distance, 0.0)
        present = maximum(count_over(beside, 1), 1)
    return (sum_in_order(distance, 1) * 3.0 / present.astype(DOUBLE)).astype(REAL)


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


def _gather(
    surface: Living, centres: Array, gone: Array, index: Array, shares: Array, literal: bool
) -> tuple[Array, Array]:
    """What each face has gathered after the pass, and the shares of that: F x W each, with zeros
    for faces that have not survived."""
    neighbours = surface.beside & surface.of_neighbours(gone)
    touched = any_over(neighbours, 1, keepdims=True)
    sources = [~touched if literal else touched | ~touched, neighbours]
    if literal:
        sources.append(touched & ~neighbours & _are_of_one_region(surface, centres))
    taken = concatenate(sources, 1) & expand(surface.alive & ~gone, 1)  # F x 4 or 7
    sides = [0, 1, 2] * (2 if literal else 1)

    def of_sources(table: Array) -> Array:
        """F x W -> F x 4 W or 7 W, 0 for what is not taken."""
        rows = take(surface.of_neighbours(table), sides, axis=1)
        rows = concatenate([expand(table, 1), rows], 1)
        width = table.size(1) * (1 + len(sides))
        return where(expand(taken, 2), rows, constant(0, table.dtype)).reshape(-1, width)

    index = of_sources(index)
    if literal:
        shares = of_sources(shares)
        shares = shares / maximum(count_over(taken, 1, keepdims=True), 1).astype(DOUBLE)
    else:
        present = maximum(count_over(index > 0, 1, keepdims=True), 1)
        # Not times 1 / present: onnxruntime 1.20 crashes as it fuses these two within a loop.
        shares = (index > 0).astype(DOUBLE) / present.astype(DOUBLE)
    # Without gaps.
    places = cumulative_sum((index > 0).astype(INT), axis=1)
    width = max_over(places)
    at = where(index > 0, places - 1, 0)

    def compact(table: Array) -> Array:
        return scatter(full(0, table.dtype, table.size(), width), at, table, axis=1, join="add")

    return compact(index), compact(shares)


def _are_of_one_region(surface: Living, centres: Array) -> Array:
    """Whether each face and its three neighbours lie beside faces of one collapse: F x 3."""
    none = constant(-1)
    number = arange(surface.faces.size())
    beside = where(surface.beside & surface.of_neighbours(centres), surface.neighbours, none)
    centre = where(centres, number, max_over(beside, 1))
    regions = where(surface.beside, surface.of_neighbours(centre), none)  # F x 3
    others = surface.of_neighbours(regions)  # F x 3 x 3
    same = (expand(regions, 1, 3) == expand(others, 2)) & (expand(others, 2) >= 0)
    return surface.beside & any_over(any_over(same, 3), 2)


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


def _compact(faces: Array, twin: Array, alive: Array, index: Array, shares: Array) -> PooledFaces:
    """Number the living faces 0 to F' - 1."""
    kept = nonzero(alive)
    number = cumulative_sum(alive.astype(INT)) - 1
    twin = twin.reshape(-1, 3)[kept].reshape(-1)
    over = maximum(twin, 0)
    twin = where(twin >= 0, number[over // 3] * 3 + over % 3, -1)
    return PooledFaces(kept, faces[kept], twin, index[kept], shares[kept])
