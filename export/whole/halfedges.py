"""The mesh as half-edges: twins, the sorted adjacency, and patches.

Arrays are those of `model.topology.halfedges`, as int64.
"""

import numpy as np

from meshconv3d.export.whole.arrays import (
    BOOL,
    END,
    INT,
    Array,
    any_over,
    arange,
    broadcast,
    concatenate,
    constant,
    count_over,
    crop,
    cumulative_sum,
    expand,
    full,
    loop,
    maximum,
    minimum,
    roll,
    scatter,
    sort,
    sum_over,
    take,
    take_along,
    where,
)
from meshconv3d.export.whole.geometry import length


def find_twins(faces: Array, vertex_count: Array) -> Array:
    """Pair the half-edges of triangles that share an edge: H.

    faces: F x 3, none with a vertex twice. Of three half-edges or more over one edge, which a
    prepared mesh has not, none has a twin.
    """
    starts, ends = half_edges(faces)
    edges = minimum(starts, ends) * vertex_count + maximum(starts, ends)
    count = edges.size()
    edges, order = sort(edges, count)
    # Whether the half-edge at each place, and those one before and after, is over one edge with
    # the next.
    same = crop(edges, 1, END) == crop(edges, 0, -1)
    no = constant([False], BOOL)
    same = concatenate([no, same, no, no], 0)
    first = crop(same, 1, -1) & ~crop(same, 0, -2) & ~crop(same, 2, END)
    second = concatenate([no, crop(first, 0, -1)], 0)
    twin = where(first, roll(order, 1, 0), where(second, roll(order, -1, 0), -1))
    return scatter(twin, order, twin)


def number_used(faces: Array, vertex_count: Array) -> tuple[Array, Array]:
    """The faces, F x 3, over their own vertices, numbered anew; and how many these are."""
    corners = faces.reshape(-1)
    ones = full(1, INT, corners.size())
    numbers = cumulative_sum(scatter(full(0, INT, vertex_count), corners, ones, join="max"))
    return (numbers - 1)[faces], numbers[-1]


def half_edges(faces: Array) -> tuple[Array, Array]:
    """The vertices at which half-edges start and end: H each."""
    return faces.reshape(-1), roll(faces, 1, axis=1).reshape(-1)


def edge_lengths(vertices: Array, faces: Array) -> Array:
    """Length of every half-edge, H float64. vertices: V x 3 float64."""
    starts, ends = half_edges(faces)
    return length(vertices[starts] - vertices[ends]).reshape(-1)


def sort_adjacency(twin: Array, lengths: Array) -> Array:
    """Neighbours of every face, F x 3 of face + 1, shortest edge first; 0, the null face, last."""
    beside = twin >= 0
    keys = where(beside, lengths + lengths[twin], np.inf).reshape(-1, 3)
    _, order = sort(keys, 3, axis=1)
    return take_along(where(beside, twin // 3 + 1, 0).reshape(-1, 3), order, axis=1)


def grow_patches(adjacency: Array, patch_size: int) -> Array:
    """K-face patches, F x K of face + 1, breadth first.

    All patches are grown at once: in step i, by those neighbours of their i-th faces that they do
    not contain, until each has K faces or has seen the neighbours of all of its faces.
    """
    count = adjacency.size()
    table = concatenate([constant([[0, 0, 0]]), adjacency], 0)
    columns = arange(patch_size).reshape(1, patch_size, 1)
    itself = expand(arange(count, start=1), 1)
    rest = full(0, INT, count, patch_size - 1)

    def visit(patches: Array, found: Array, step: Array) -> tuple[Array, ...]:
        near = table[take(patches, step, axis=1)]
        new = (near > 0) & ~any_over(expand(near, 2) == expand(patches, 1), axis=2)
        # A face may have one neighbour across two edges.
        one, two, three = (take(near, [s], axis=1) for s in range(3))
        yes = broadcast(constant(True, BOOL), count, 1)
        new = new & concatenate([yes, ~(two == one), ~(three == one) & ~(three == two)], 1)
        places = found + cumulative_sum(new.astype(INT), axis=1) - 1
        here = (columns == expand(places, 1)) & expand(new, 1)
        patches = patches + sum_over(here.astype(INT) * expand(near, 1), axis=2)
        found = minimum(found + count_over(new, 1, keepdims=True), patch_size)
        step = step + 1
        return any_over((found > step) & (found < patch_size)), patches, found, step

    if patch_size == 1:
        return itself
    state = concatenate([itself, rest], 1), full(1, INT, count, 1), constant(0)
    patches, _, _ = loop(constant(True, BOOL), visit, state)
    return patches
