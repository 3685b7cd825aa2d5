"""Edge collapse on half-edges: an edge becomes a vertex, and the faces beside it go.

Collapses that meet the link condition keep the topology of a manifold with borders: components stay
in one piece, closed or open, of their genus, with their holes (Dey, Edelsbrunner, Guha and Nekhayev
1999).
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from meshconv3d.model.jit import kernel
from meshconv3d.model.topology.geometry import Vector, cross, dot, row, subtract
from meshconv3d.model.topology.halfedges import pair

# A face is degenerate when twice its area is at most this share of its longest side squared.
THINNEST = 1e-6


class HalfEdges(NamedTuple):
    """A manifold whose edges are collapsed in place.

    vertices: V x 3 float64. start: H int32, the vertex that each half-edge leaves, -1 in faces that
    are gone. twin: H int32. first: V int32, a half-edge that leaves each vertex, at a border the
    one with all others to its left. valence: V int32, faces around each vertex. border: V bool.
    """

    vertices: NDArray[np.float64]
    start: NDArray[np.int32]
    twin: NDArray[np.int32]
    first: NDArray[np.int32]
    valence: NDArray[np.int32]
    border: NDArray[np.bool_]


@kernel
def half_edges(
    vertices: NDArray[np.float64], faces: NDArray[np.int32], twin: NDArray[np.int32]
) -> HalfEdges:
    """Copy a manifold (twin: H int32), so that its edges can be collapsed."""
    start = faces.copy().reshape(-1)
    first = np.full(len(vertices), -1, np.int32)
    valence = np.zeros(len(vertices), np.int32)
    border = np.zeros(len(vertices), np.bool_)
    for h in range(len(twin)):
        u = start[h]
        valence[u] += 1
        if first[u] < 0 or twin[h] < 0:
            first[u] = h
        if twin[h] < 0:
            border[u] = border[start[next_side(h)]] = True
    return HalfEdges(vertices.copy(), start, twin.copy(), first, valence, border)


@kernel
def next_side(h: int) -> int:
    """The half-edge after h around its face."""
    return h - 2 if h % 3 == 2 else h + 1


@kernel
def previous_side(h: int) -> int:
    """The half-edge before h around its face."""
    return h + 2 if h % 3 == 0 else h - 1


@kernel
def turn_left(mesh: HalfEdges, h: int) -> int:
    """The next half-edge to the left that leaves the same vertex, -1 behind a border."""
    return mesh.twin[previous_side(h)]  # type: ignore


@kernel
def meets_link_condition(
    mesh: HalfEdges, h: int, u: int, v: int, met: NDArray[np.int32], attempt: int
) -> bool:
    """Whether an edge's ends have no other common neighbours than the corners across the edge.

    h: half-edge from u to v. met: V int32, in which `attempt`, a new number each time, marks
    neighbours of u. False for an inner edge that joins two borders, for the edges of a tetrahedron
    and for those of a single triangle.
    """
    start, twin = mesh.start, mesh.twin
    if twin[h] >= 0 and mesh.border[u] and mesh.border[v]:
        return False
    g = mesh.first[u]
    while True:
        met[start[g]] = met[start[next_side(g)]] = met[start[previous_side(g)]] = attempt
        g = turn_left(mesh, g)
        if g < 0 or g == mesh.first[u]:
            break
    common = 0
    g = mesh.first[v]
    while True:
        common += met[start[next_side(g)]] == attempt
        last = start[previous_side(g)]
        g = turn_left(mesh, g)
        if g == mesh.first[v]:
            break
        if g < 0:
            common += met[last] == attempt
            break
    # u itself is one of those that were met.
    if twin[h] < 0:
        alone = twin[next_side(h)] < 0 and twin[previous_side(h)] < 0
        return common == 2 and not alone
    tetrahedron = mesh.valence[u] == 3 and mesh.valence[v] == 3
    return common == 3 and (mesh.border[u] or mesh.border[v] or not tetrahedron)


# What becomes of the faces around a vertex that moves.
SOUND, TURNED, DEGENERATE = 0, 1, 2


@kernel
def effect_of_moving(mesh: HalfEdges, u: int, v: int, place: Vector) -> int:
    """Whether a face at u, but not at v, turns over or becomes degenerate as u moves."""
    effect = SOUND
    g = mesh.first[u]
    while True:
        x, y = mesh.start[next_side(g)], mesh.start[previous_side(g)]
        if x != v and y != v:
            corner = row(mesh.vertices, x)
            edge, side = subtract(row(mesh.vertices, y), corner), subtract(place, corner)
            old = cross(edge, subtract(row(mesh.vertices, u), corner))
            new = cross(edge, side)
            longest = max(dot(edge, edge), dot(side, side))
            if dot(new, new) <= (THINNEST * longest) ** 2:
                return DEGENERATE
            if dot(old, new) <= 0:
                effect = TURNED
        g = turn_left(mesh, g)
        if g < 0 or g == mesh.first[u]:
            return effect


@kernel
def collapse_edge(mesh: HalfEdges, h: int, u: int, v: int) -> int:
    """Remove vertex v and the faces at h, which runs from u to v; u takes the place of v.

    Returns the number of faces that went, one at a border.
    """
    start, twin, first, valence = mesh.start, mesh.twin, mesh.first, mesh.valence
    t = twin[h]
    g = first[v]
    while True:
        start[g] = u
        g = turn_left(mesh, g)
        if g < 0 or g == first[v]:
            break
    # The corners across the edge, w left of it and x right of it, and the half-edges outside:
    # from w to v, from u to w, from x to u, from v to x.
    w, wv, uw = start[previous_side(h)], twin[next_side(h)], twin[previous_side(h)]
    pair(twin, wv, uw)
    if first[w] // 3 == h // 3:
        first[w] = wv
    valence[w] -= 1
    valence[u] += valence[v] - 2
    leaving = first[v] if mesh.border[v] else first[u]
    if leaving // 3 == h // 3 or leaving == t:
        leaving = uw
    if t >= 0:
        x, xu, vx = start[previous_side(t)], twin[next_side(t)], twin[previous_side(t)]
        pair(twin, xu, vx)
        if first[x] // 3 == t // 3:
            first[x] = xu
        valence[x] -= 1
        valence[u] -= 2
        if leaving == next_side(t):
            leaving = vx
        start[t] = start[next_side(t)] = start[previous_side(t)] = -1
    start[h] = start[next_side(h)] = start[previous_side(h)] = -1
    first[u] = leaving
    mesh.border[u] |= mesh.border[v]
    return 2 if t >= 0 else 1
