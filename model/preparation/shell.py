"""The outer shell of a mesh that has walls inside, as the cells of a volume mesh are.

A walker on one side of a face crosses each of its edges to the side of the next face around that
edge, and around a border to the back of the same face. The sides that can be reached from one
another enclose a cell of space, or look at it from outside. Faces that do not look outside on
either side are walls; to a viewer, the shape is the rest.
"""

import math

import numpy as np
from numpy.typing import NDArray

from meshconv3d.model.jit import kernel
from meshconv3d.model.topology.geometry import cross, dot, row, subtract
from meshconv3d.model.topology.halfedges import ascends, end_of_edge


@kernel
def find_walls(
    vertices: NDArray[np.float64],
    faces: NDArray[np.int32],
    edges: tuple[NDArray[np.int32], NDArray[np.int32], NDArray[np.int32]],
) -> NDArray[np.bool_]:
    """Faces (F bool) that are enclosed by others of their component.

    edges: what `sort_edges` returns. A component that can be entered through a border has no walls.
    Time grows with the faces.
    """
    component, is_open = _components(faces, edges)
    if is_open.all():
        return np.zeros(len(faces), np.bool_)
    side = np.arange(2 * len(faces)).astype(np.int32)
    order, low, high = edges
    start = 0
    while start < len(order):
        end = end_of_edge(order, low, high, start)
        if not is_open[order[start] // 3]:
            if end - start == 2:
                _join_sides(side, faces, order[start], order[start + 1])
                _join_sides(side, faces, order[start + 1], order[start])
            else:
                around = order[start:end]
                around = around[np.argsort(_angles(vertices, faces, around), kind="mergesort")]
                for i in range(len(around)):
                    _join_sides(side, faces, around[i], around[(i + 1) % len(around)])
        start = end
    for i in range(len(side)):
        side[i] = find_root(side, i)
    return _look_at_no_outside(vertices, faces, side, component, is_open)


@kernel
def _components(
    faces: NDArray[np.int32],
    edges: tuple[NDArray[np.int32], NDArray[np.int32], NDArray[np.int32]],
) -> tuple[NDArray[np.int32], NDArray[np.bool_]]:
    """The first face of each face's component, F int32, and whether that has a border, F bool."""
    component = np.arange(len(faces)).astype(np.int32)
    is_open = np.zeros(len(faces), np.bool_)
    order, low, high = edges
    start = 0
    while start < len(order):
        end = end_of_edge(order, low, high, start)
        is_open[order[start] // 3] |= end - start == 1
        for i in range(start + 1, end):
            join(component, order[i - 1] // 3, order[i] // 3)
        start = end
    for f in range(len(faces)):
        component[f] = find_root(component, f)
        is_open[component[f]] |= is_open[f]
    for f in range(len(faces)):
        is_open[f] = is_open[component[f]]
    return component, is_open


@kernel
def _join_sides(side: NDArray[np.int32], faces: NDArray[np.int32], h: int, next_h: int) -> None:
    """Join the side of h that looks along the turn, and that of the next that looks against it."""
    join(
        side,
        2 * (h // 3) + (0 if ascends(faces, h) else 1),
        2 * (next_h // 3) + (1 if ascends(faces, next_h) else 0),
    )


@kernel
def _angles(
    vertices: NDArray[np.float64], faces: NDArray[np.int32], around: NDArray[np.int32]
) -> NDArray[np.float64]:
    """Angle of each face around the edge that all share, from the first, seen along the edge."""
    f, s = around[0] // 3, around[0] % 3
    u, v = faces[f, s], faces[f, (s + 1) % 3]
    origin = row(vertices, min(u, v))
    axis = subtract(row(vertices, max(u, v)), origin)
    x_axis = y_axis = (0.0, 0.0, 0.0)
    angles = np.zeros(len(around))
    for i in range(len(around)):
        apex = row(vertices, faces[around[i] // 3, (around[i] % 3 + 2) % 3])
        # Across the edge, at a right angle to it; y has the scale of the axis more than x.
        across = cross(axis, subtract(apex, origin))
        if i == 0:
            y_axis = across
            x_axis = cross(across, axis)
        # `across` is the direction of the face turned by a right angle about the axis.
        angles[i] = math.atan2(
            -dot(across, x_axis), dot(across, y_axis) * math.sqrt(dot(axis, axis))
        )
    return angles


@kernel
def _look_at_no_outside(
    vertices: NDArray[np.float64],
    faces: NDArray[np.int32],
    side: NDArray[np.int32],
    component: NDArray[np.int32],
    is_open: NDArray[np.bool_],
) -> NDArray[np.bool_]:
    """Which faces of closed components look at no outside.

    side: 2 F int32, the cell that the front and the back of each face look at. The outside of a
    component is, of the cells as long, wide and high as itself, the one that spans the largest
    volume: inside is negative.
    """
    volumes = np.zeros(len(side))
    low, high = np.full((len(side), 3), np.inf), np.full((len(side), 3), -np.inf)
    whole_low, whole_high = np.full((len(faces), 3), np.inf), np.full((len(faces), 3), -np.inf)
    for f in range(len(faces)):
        if is_open[f]:
            continue
        a, b, c = row(vertices, faces[f, 0]), row(vertices, faces[f, 1]), row(vertices, faces[f, 2])
        volume = dot(a, cross(b, c))
        part, front, back = component[f], side[2 * f], side[2 * f + 1]
        volumes[front] += volume
        volumes[back] -= volume
        for k in range(3):
            least, most = min(a[k], b[k], c[k]), max(a[k], b[k], c[k])
            for cell in (front, back):
                low[cell, k], high[cell, k] = min(low[cell, k], least), max(high[cell, k], most)
            whole_low[part, k] = min(whole_low[part, k], least)
            whole_high[part, k] = max(whole_high[part, k], most)
    outside = np.full(len(faces), -1, np.int32)
    for cell in range(len(side)):
        part = component[cell // 2]
        spans = side[cell] == cell and not is_open[part]
        for k in range(3):
            spans &= low[cell, k] == whole_low[part, k] and high[cell, k] == whole_high[part, k]
        if spans and (outside[part] < 0 or volumes[cell] > volumes[outside[part]]):
            outside[part] = cell
    leaks = is_open.copy()
    for f in range(len(faces)):
        part = component[f]
        leaks[part] |= side[2 * f] == outside[part] and side[2 * f + 1] == outside[part]
    walls = np.zeros(len(faces), np.bool_)
    for f in range(len(faces)):
        out = outside[component[f]]
        walls[f] = not leaks[component[f]] and side[2 * f] != out and side[2 * f + 1] != out
    return walls


@kernel
def join(parent: NDArray, a: int, b: int) -> None:
    """Union-find: make one set of those of a and b, whose root is the least of its members."""
    a, b = find_root(parent, a), find_root(parent, b)
    parent[max(a, b)] = min(a, b)


@kernel
def find_root(parent: NDArray, node: int) -> int:
    while parent[node] != node:
        parent[node] = parent[parent[node]]
        node = parent[node]
    return node
