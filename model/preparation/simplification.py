"""Simplification: quadric edge collapse from above to the face budget.

`simplify` collapses the edge that costs least, again and again; an edge costs what the quadrics of
its ends sum to at their least point (Garland and Heckbert 1997). Edges wait in a queue of buckets,
by the logarithm of their cost. A collapse only raises the costs around it, so an edge is measured
again when its turn comes, and waits on if it costs more by then: time is linear in the faces.

Everything is decided by costs and by the order of vertices and faces, which `cleaning` makes that
of their coordinates: how a file numbers its mesh changes nothing.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from meshconv3d.model.jit import kernel
from meshconv3d.model.preparation.cleaning import drop_unused
from meshconv3d.model.preparation.edge_collapse import (
    DEGENERATE,
    TURNED,
    HalfEdges,
    collapse_edge,
    effect_of_moving,
    half_edges,
    meets_link_condition,
    next_side,
    previous_side,
    turn_left,
)
from meshconv3d.model.preparation.quadrics import least_point, vertex_quadrics
from meshconv3d.model.topology.geometry import Vector, row, write

# A collapse that turns a face over waits until others cost this many times as much.
TURN_COST = 10.0
# Faces around both ends up to which an edge is collapsed: the spokes of a wheel wait until its rim
# has fewer edges, or each would take time in proportion to their number.
MOST_FACES_AROUND = 256
# How many of the last bits of a cost, a float32, its bucket leaves out: there are four buckets to
# each power of two, or one to eight powers. In coarse buckets edges go in the order of memory,
# which is faster for very many faces. They are used down to MANY_BUDGETS, so that nothing of it is
# left to see.
FINE, COARSE = 21, 26
MANY_BUDGETS = 20
BUCKETS = 1 << 10
# When every edge has had its turn, all have another if that removed this share of the excess.
LEAST_PROGRESS = 1 / 4


def simplify(
    vertices: NDArray[np.float64],
    faces: NDArray[np.int32],
    twin: NDArray[np.int32],
    budget: int,
) -> tuple[NDArray[np.float64], NDArray[np.int32], NDArray[np.int64]]:
    """Simplify an oriented manifold of more than `budget` faces, whose half-edges have twins (H).

    Returns (vertices, faces, origin): origin, which of the faces given each one was. The last
    collapse of an inner edge can leave one face less than the budget. More are left where no
    collapse is allowed any more: a closed part has four faces at least, an open one has one, and
    handles and holes need more.
    """
    mesh = half_edges(vertices, faces, twin)
    quadrics = vertex_quadrics(vertices, faces, twin)
    living = len(faces)
    if living > 2 * MANY_BUDGETS * budget:
        living = _collapse_edges(mesh, quadrics, living, MANY_BUDGETS * budget, COARSE)
    _collapse_edges(mesh, quadrics, living, budget, FINE)
    left = mesh.start.reshape(-1, 3)
    origin = np.flatnonzero(left[:, 0] >= 0)
    return *drop_unused(mesh.vertices, left[origin]), origin


class Queue(NamedTuple):
    """Half-edges in buckets, first in, first out.

    after: H int32, the one behind each, END or ABSENT. head, tail: of each bucket; the head is END
    if it is empty.
    """

    after: NDArray[np.int32]
    head: NDArray[np.int32]
    tail: NDArray[np.int32]


END, ABSENT = -1, -2


@kernel
def _collapse_edges(
    mesh: HalfEdges, quadrics: NDArray[np.float64], living: int, budget: int, shift: int
) -> int:
    """Collapse edges of a mesh of `living` faces until `budget` are left or none is allowed.

    shift: FINE or COARSE. Returns how many faces are left.
    """
    queue = Queue(
        np.full(len(mesh.twin), ABSENT, np.int32),
        np.full(BUCKETS, END, np.int32),
        np.empty(BUCKETS, np.int32),
    )
    # For each vertex, the number of the last attempt that met it.
    met = np.zeros(len(mesh.vertices), np.int32)
    attempt = 0
    excess = 0
    current = BUCKETS
    while living > budget:
        while current < BUCKETS and queue.head[current] == END:
            current += 1
        if current == BUCKETS:
            if excess > 0 and living - budget > (1 - LEAST_PROGRESS) * excess:
                break
            excess = living - budget
            _push_all_edges(mesh, quadrics, queue, shift)
            current = 0
            continue
        h = queue.head[current]
        queue.head[current] = queue.after[h]
        queue.after[h] = ABSENT
        if mesh.start[h] < 0:
            continue
        u, v = mesh.start[h], mesh.start[next_side(h)]
        if mesh.valence[u] + mesh.valence[v] > MOST_FACES_AROUND:
            continue
        place, cost = _least_point(mesh, quadrics, u, v)
        if _bucket(cost, shift) > current:
            _push(queue, h, _bucket(cost, shift))
            continue
        attempt += 1
        if not meets_link_condition(mesh, h, u, v, met, attempt):
            continue
        effect = max(effect_of_moving(mesh, u, v, place), effect_of_moving(mesh, v, u, place))
        if effect == DEGENERATE:
            continue
        if effect == TURNED and _bucket(TURN_COST * cost, shift) > current:
            _push(queue, h, _bucket(TURN_COST * cost, shift))
            continue
        living -= collapse_edge(mesh, h, u, v)
        write(mesh.vertices, u, place)
        for i in range(10):
            quadrics[u, i] += quadrics[v, i]
        _push_edges_around(mesh, queue, u, current)
    return living


@kernel
def _least_point(
    mesh: HalfEdges, quadrics: NDArray[np.float64], u: int, v: int
) -> tuple[Vector, float]:
    return least_point(quadrics, u, v, row(mesh.vertices, u), row(mesh.vertices, v))


@kernel
def _push_all_edges(
    mesh: HalfEdges, quadrics: NDArray[np.float64], queue: Queue, shift: int
) -> None:
    """Queue every edge, by the later of its half-edges."""
    for h in range(len(mesh.twin)):
        if mesh.twin[h] > h or mesh.start[h] < 0:
            continue
        u, v = mesh.start[h], mesh.start[next_side(h)]
        _push(queue, h, _bucket(_least_point(mesh, quadrics, u, v)[1], shift))


@kernel
def _push_edges_around(mesh: HalfEdges, queue: Queue, u: int, bucket: int) -> None:
    """Queue the edges at a vertex that are not in the queue: they may be allowed now."""
    g = mesh.first[u]
    while True:
        t = mesh.twin[g]
        if queue.after[g] == ABSENT and (t < 0 or queue.after[t] == ABSENT):
            _push(queue, g, bucket)
        last = previous_side(g)
        g = turn_left(mesh, g)
        if g < 0 and queue.after[last] == ABSENT:
            _push(queue, last, bucket)
        if g < 0 or g == mesh.first[u]:
            break


@kernel
def _bucket(cost: float, shift: int) -> int:
    return np.float32(cost).view(np.int32) >> shift  # type: ignore


@kernel
def _push(queue: Queue, h: int, bucket: int) -> None:
    queue.after[h] = END
    if queue.head[bucket] == END:
        queue.head[bucket] = h
    else:
        queue.after[queue.tail[bucket]] = h
    queue.tail[bucket] = h
