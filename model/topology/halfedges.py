"""The mesh as half-edges: twins, the sorted adjacency, and patches (paper, section III).

Half-edge h = 3 f + s is side s of face f and runs from its corner s to corner (s + 1) mod 3.
`twin[h]` is the half-edge on the other side, -1 on a border. Face, side and neighbour follow
from that one array: h // 3, h % 3, twin[h] // 3.
"""

import numpy as np
from numpy.typing import NDArray

from meshconv3d.model.jit import kernel
from meshconv3d.model.topology.geometry import length, row, subtract


@kernel
def find_twins(
    faces: NDArray[np.int32], vertex_count: int, pair_nonmanifold: bool = True
) -> tuple[NDArray[np.int32], int, int]:
    """Pair the half-edges of triangles that share an edge, in O(V + F).

    faces: F x 3 int32, entries in [0, vertex_count).
    Returns (twin, border, nonmanifold): twin is H int32, border the number of edges with one
    face, nonmanifold the number of edges with three faces or more.

    Two half-edges over one edge are twins, whichever way they run. Three or more are a
    non-manifold edge: in ascending order, each half-edge is paired with the next free one that
    runs the other way, and the rest become borders; without pair_nonmanifold, all do. A face
    that names a vertex twice has no neighbours.
    """
    return pair_edges(faces, sort_edges(faces, vertex_count), pair_nonmanifold)


@kernel
def pair_edges(
    faces: NDArray[np.int32],
    edges: tuple[NDArray[np.int32], NDArray[np.int32], NDArray[np.int32]],
    pair_nonmanifold: bool,
) -> tuple[NDArray[np.int32], int, int]:
    """`find_twins`, of what `sort_edges` returns."""
    order, low, high = edges
    twin = np.full(3 * len(faces), -1, np.int32)
    border = 0
    nonmanifold = 0
    start = 0
    while start < len(order):
        first = order[start]
        end = end_of_edge(order, low, high, start)
        if end - start == 1:
            border += 1
        elif end - start == 2:
            twin[first] = order[start + 1]
            twin[order[start + 1]] = first
        else:
            nonmanifold += 1
            if pair_nonmanifold:
                _pair_opposite(faces, order[start:end], twin)
        start = end
    return twin, border, nonmanifold


@kernel
def sort_edges(
    faces: NDArray[np.int32], vertex_count: int
) -> tuple[NDArray[np.int32], NDArray[np.int32], NDArray[np.int32]]:
    """Half-edges sorted by (low vertex, high vertex, id), by two stable counting sorts."""
    half_edges = 3 * len(faces)
    low = np.empty(half_edges, np.int32)
    high = np.empty(half_edges, np.int32)
    valid = np.empty(half_edges, np.int32)
    count = 0
    for f in range(len(faces)):
        a, b, c = faces[f, 0], faces[f, 1], faces[f, 2]
        degenerate = a == b or b == c or c == a
        for s in range(3):
            u, v = faces[f, s], faces[f, (s + 1) % 3]
            low[3 * f + s] = min(u, v)
            high[3 * f + s] = max(u, v)
            if not degenerate:
                valid[count] = 3 * f + s
                count += 1
    by_high = counting_sort(valid[:count], high, vertex_count)
    return counting_sort(by_high, low, vertex_count), low, high


@kernel
def end_of_edge(
    order: NDArray[np.int32], low: NDArray[np.int32], high: NDArray[np.int32], start: int
) -> int:
    """Where, in what `sort_edges` returns, the half-edges over the edge at `start` end."""
    end = start + 1
    while (
        end < len(order)
        and low[order[end]] == low[order[start]]
        and high[order[end]] == high[order[start]]
    ):
        end += 1
    return end


@kernel
def pair(twin: NDArray[np.int32], one: int, other: int) -> None:
    """Make two half-edges twins; where one is -1, the other is of a border."""
    if one >= 0:
        twin[one] = other
    if other >= 0:
        twin[other] = one


@kernel
def counting_sort(
    ids: NDArray[np.int32], keys: NDArray[np.int32], key_count: int
) -> NDArray[np.int32]:
    """Sort ids by their keys, which are in [0, key_count); ids of one key keep their order."""
    # How many ids have a key; then, where the next of them goes.
    places = np.zeros(key_count, np.uint32)
    for i in ids:
        places[keys[i]] += 1
    start = 0
    for key in range(key_count):
        places[key], start = start, start + places[key]
    result = np.empty_like(ids)
    for i in ids:
        place = places[keys[i]]
        places[keys[i]] += 1
        result[place] = i
    return result


@kernel
def _pair_opposite(
    faces: NDArray[np.int32], run: NDArray[np.int32], twin: NDArray[np.int32]
) -> None:
    forward = 0
    backward = 0
    while True:
        while forward < len(run) and not ascends(faces, run[forward]):
            forward += 1
        while backward < len(run) and ascends(faces, run[backward]):
            backward += 1
        if forward == len(run) or backward == len(run):
            return
        twin[run[forward]] = run[backward]
        twin[run[backward]] = run[forward]
        forward += 1
        backward += 1


@kernel
def ascends(faces: NDArray[np.int32], h: int) -> bool:
    return faces[h // 3, h % 3] < faces[h // 3, (h % 3 + 1) % 3]


@kernel
def edge_lengths(vertices: NDArray[np.float64], faces: NDArray[np.int32]) -> NDArray[np.float64]:
    """Length of every half-edge, H float64, in the units of `vertices`."""
    lengths = np.empty(3 * len(faces))
    for f in range(len(faces)):
        for s in range(3):
            step = subtract(row(vertices, faces[f, s]), row(vertices, faces[f, (s + 1) % 3]))
            lengths[3 * f + s] = length(step)
    return lengths


@kernel
def sort_adjacency(twin: NDArray[np.int32], lengths: NDArray[np.float64]) -> NDArray[np.int32]:
    """Neighbours of every face, by shared edge, shortest first (paper, section III).

    twin: H int32. lengths: H float64. Returns F x 3 int32 of face + 1, missing neighbours last
    as 0, the null face. After pooling the two sides of an edge may differ in length: their sum
    is the key, so that both faces agree on it. Equal lengths keep the order of the sides.
    """
    faces = len(twin) // 3
    adjacency = np.zeros((faces, 3), np.int32)
    keys = np.empty(3)
    for f in range(faces):
        found = 0
        for h in range(3 * f, 3 * f + 3):
            if twin[h] < 0:
                continue
            key = lengths[h] + lengths[twin[h]]
            slot = found
            while slot > 0 and keys[slot - 1] > key:
                keys[slot] = keys[slot - 1]
                adjacency[f, slot] = adjacency[f, slot - 1]
                slot -= 1
            keys[slot] = key
            adjacency[f, slot] = twin[h] // 3 + 1
            found += 1
    return adjacency


@kernel
def grow_patches(adjacency: NDArray[np.int32], patch_size: int) -> NDArray[np.int32]:
    """K-face patches (section III.B): walk breadth first from every face until K are found.

    adjacency: F x 3 int32 of face + 1, 0 for none, as `sort_adjacency` returns it.
    patch_size: K >= 1, counting the face itself.
    Returns F x K int32 of face + 1: the face, its neighbours, then the unseen neighbours of
    each in turn; 0, the null face, where the component has fewer than K faces.
    """
    faces = len(adjacency)
    patches = np.zeros((faces, patch_size), np.int32)
    seen_by = np.full(faces + 1, -1, np.int32)
    for f in range(faces):
        patches[f, 0] = f + 1
        seen_by[f + 1] = f
        found = 1
        visited = 0
        while visited < found < patch_size:
            g = patches[f, visited] - 1
            for slot in range(3):
                neighbour = adjacency[g, slot]
                if neighbour > 0 and seen_by[neighbour] != f and found < patch_size:
                    patches[f, found] = neighbour
                    seen_by[neighbour] = f
                    found += 1
            visited += 1
    return patches
