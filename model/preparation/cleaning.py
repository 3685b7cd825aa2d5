"""From triangles as found to an oriented manifold, possibly with borders.

`clean` runs the steps in their order. Each step takes and returns plain arrays, vertices V x 3
float64 in the unit box and faces F x 3 int32, and a count of what it changed.
"""

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from meshconv3d.model.errors import UnusableMesh
from meshconv3d.model.jit import kernel
from meshconv3d.model.mesh import Mesh
from meshconv3d.model.preparation.shell import find_walls
from meshconv3d.model.topology.geometry import (
    FaceGeometry,
    cross,
    dot,
    face_geometry,
    length,
    row,
    subtract,
    surface_centroid,
    write,
)
from meshconv3d.model.topology.halfedges import counting_sort, find_twins, pair_edges, sort_edges

# The welding grid divides each axis of the unit box into 2^20 steps, 1e-6 of the mesh's size:
# coarser than the rounding of float32 coordinates, finer than any edge worth keeping. Coordinates
# are often halves, quarters, ... of a side, down to what float32 resolves: none of these may lie
# between two grid points, where rounding would decide. The shift puts an irrational number there.
# Three numbers of 21 bits fit one 64-bit key.
GRID_STEPS = 1 << 20
GRID_SHIFT = (2**0.5 - 1) / 2
GRID_BITS = 21

# A triangle is degenerate when twice its area is below this share of its longest edge squared:
# the height is then lost in rounding, and with it the normal.
FLATNESS = 1e-10

# An open component is turned away from its own centre when the volume that it spans with that
# centre is at least this share of area^1.5; a sheet flatter than that has no outside. (A closed
# sphere has 0.094.)
OPEN_VOLUME = 1e-3
CLOSED_VOLUME = 1e-12


class CleanSurface(NamedTuple):
    """An oriented manifold, possibly with borders, in the unit box.

    vertices: V x 3 float64. faces: F x 3 int32. counts: the fields of `MeshReport` that cleaning
    decides. twin: H int32. component: F int32, the part of each face; parts share no edge.
    corner, size: of the unit box in the file, its lowest corner, 3 float64, and its side.
    """

    vertices: NDArray[np.float64]
    faces: NDArray[np.int32]
    counts: dict[str, Any]
    twin: NDArray[np.int32]
    component: NDArray[np.int32]
    corner: NDArray[np.float64]
    size: float


def clean(mesh: Mesh) -> CleanSurface:
    """Weld, drop what has no area or is there twice, separate what only touches, orient.

    Vertices, faces and corners come in an order that follows from where they lie, not from the
    file: what breaks ties by order later breaks them alike however the mesh is written down. Raises
    UnusableMesh where no face has an area.
    """
    vertices, faces, vertices_in, corner, size = weld(mesh)
    merged = vertices_in - len(vertices)
    faces, degenerate = drop_degenerate(vertices, faces)
    if len(faces) == 0:
        raise UnusableMesh(
            "no-area",
            f"none of the {len(mesh.faces)} faces has an area: all are lines or "
            "points; export the surface, in units in which it does not vanish",
        )
    faces, winding, duplicates = merge_duplicates(faces, len(vertices))
    edges = sort_edges(faces, len(vertices))
    twin, border, nonmanifold = pair_edges(faces, edges, False)
    apart, walls = nonmanifold, 0
    if nonmanifold:
        outer = ~find_walls(vertices, faces, edges)
        walls = len(faces) - int(np.count_nonzero(outer))
        if walls:
            faces, winding = faces[outer], winding[outer]
            twin, border, apart = find_twins(faces, len(vertices), False)
    component, flip, components = spread_orientation(faces, twin)
    cuts = cut_one_sided(faces, twin, flip)
    vertices, faces, copies = split_vertices(vertices, faces, twin)
    turn_faces(faces, twin, flip)
    if apart or cuts:
        # Where surfaces came apart, two faces of one may still share the edge.
        twin, border, _ = find_twins(faces, len(vertices))
        component, _, components = spread_orientation(faces, twin)
    inward = face_inward(
        vertices, faces, twin, component, components, np.where(flip, -winding, winding)
    )
    against_file = np.where(flip ^ inward, -winding, winding) < 0
    counts = {
        "vertices_in": vertices_in,
        "vertices_merged": merged,
        "degenerate_dropped": degenerate,
        "duplicates_dropped": duplicates,
        "walls_dropped": walls,
        "nonmanifold_edges": nonmanifold,
        "vertices_split": copies,
        "flipped": int(np.count_nonzero(against_file)),
        "components": components,
        "border_edges": border,
        "watertight": border == 0,
    }
    turn_faces(faces, twin, inward)
    return CleanSurface(vertices, faces, counts, twin, component, corner, size)


def weld(
    mesh: Mesh,
) -> tuple[NDArray[np.float64], NDArray[np.int32], int, NDArray[np.float64], float]:
    """Move the used vertices into the unit box, to its grid, and merge those on one point.

    In the unit box, tolerances mean the same for every mesh; on the grid, the rounding of another
    unit or origin is gone. Returns (vertices, faces, used, corner, size): the vertices sorted by
    their coordinates; how many were used; and of the box, its lowest corner and its side.
    """
    number, keys, corner, size = _grid_keys(mesh.vertices, mesh.faces)
    vertices, faces = _merge_points(mesh.faces, number, keys, np.argsort(keys))
    return vertices, faces, len(keys), corner, size


@kernel
def _grid_keys(
    vertices: NDArray[np.float64], faces: NDArray[np.int32]
) -> tuple[NDArray[np.int32], NDArray[np.int64], NDArray[np.float64], float]:
    """(number, keys, corner, size): the vertices that faces use, as points of the grid.

    number: V int32, the place of each vertex among those used, -1 for others. keys: of each used
    one, its three coordinates in grid steps, as one number. corner, size: of the unit box.
    """
    number = np.full(len(vertices), -1, np.int32)
    for f in range(len(faces)):
        for s in range(3):
            number[faces[f, s]] = 0
    low, high = np.full(3, np.inf), np.full(3, -np.inf)
    count = 0
    for v in range(len(vertices)):
        if number[v] == 0:
            number[v] = count
            count += 1
            for k in range(3):
                low[k] = min(low[k], vertices[v, k])
                high[k] = max(high[k], vertices[v, k])
    size = (high - low).max()
    keys = np.zeros(count, np.int64)
    for v in range(len(vertices)):
        if number[v] >= 0:
            for k in range(3):
                step = np.rint((vertices[v, k] - low[k]) / size * GRID_STEPS + GRID_SHIFT)
                keys[number[v]] = (keys[number[v]] << GRID_BITS) | np.int64(step)
    return number, keys, low, size


@kernel
def _merge_points(
    faces: NDArray[np.int32],
    number: NDArray[np.int32],
    keys: NDArray[np.int64],
    order: NDArray[np.int64],
) -> tuple[NDArray[np.float64], NDArray[np.int32]]:
    """Vertices and faces with one vertex for each key, in ascending `order`; see `_grid_keys`."""
    points = np.empty((len(keys), 3))
    merged_into = np.empty(len(keys), np.int32)
    last = (1 << GRID_BITS) - 1
    count = 0
    for place in range(len(order)):
        key = keys[order[place]]
        if place == 0 or key != keys[order[place - 1]]:
            x, y, z = key >> (2 * GRID_BITS), (key >> GRID_BITS) & last, key & last
            write(points, count, (x / GRID_STEPS, y / GRID_STEPS, z / GRID_STEPS))
            count += 1
        merged_into[order[place]] = count - 1
    welded = np.empty((len(faces), 3), np.int32)
    for f in range(len(faces)):
        for s in range(3):
            welded[f, s] = merged_into[number[faces[f, s]]]
    return points[:count].copy(), welded


@kernel
def drop_degenerate(
    vertices: NDArray[np.float64], faces: NDArray[np.int32]
) -> tuple[NDArray[np.int32], int]:
    """Drop faces that name a vertex twice or have no height. Returns (faces, dropped)."""
    sound = np.empty_like(faces)
    count = 0
    for f in range(len(faces)):
        a, b, c = row(vertices, faces[f, 0]), row(vertices, faces[f, 1]), row(vertices, faces[f, 2])
        ab, bc, ac = subtract(b, a), subtract(c, b), subtract(c, a)
        longest = max(dot(ab, ab), dot(bc, bc), dot(ac, ac))
        if length(cross(ab, ac)) > FLATNESS * longest:
            write(sound, count, row(faces, f))
            count += 1
    return sound[:count].copy(), len(faces) - count


@kernel
def drop_unused(
    vertices: NDArray[np.float64], faces: NDArray[np.int32]
) -> tuple[NDArray[np.float64], NDArray[np.int32]]:
    """Drop the vertices that no face uses, keeping the order of the others."""
    number = np.full(len(vertices), -1, np.int32)
    for f in range(len(faces)):
        for s in range(3):
            number[faces[f, s]] = 0
    used = np.empty_like(vertices)
    count = 0
    for v in range(len(vertices)):
        if number[v] == 0:
            number[v] = count
            write(used, count, row(vertices, v))
            count += 1
    renumbered = np.empty_like(faces)
    for f in range(len(faces)):
        for s in range(3):
            renumbered[f, s] = number[faces[f, s]]
    return used[:count].copy(), renumbered


@kernel
def merge_duplicates(
    faces: NDArray[np.int32], vertex_count: int
) -> tuple[NDArray[np.int32], NDArray[np.int8], int]:
    """One face for those over the same three vertices.

    Returns (faces, winding, dropped): faces with ascending corners, in ascending order; winding,
    F int8, whether the file wound them so (1), the other way (-1), or as often both (0).
    """
    corners = np.empty((3, len(faces)), np.int32)
    upwards = np.empty(len(faces), np.int8)
    for f in range(len(faces)):
        a, b, c = faces[f, 0], faces[f, 1], faces[f, 2]
        low, high = min(a, b, c), max(a, b, c)
        corners[0, f], corners[1, f], corners[2, f] = low, a + b + c - low - high, high
        # A triangle is wound as its sorted corners if it runs upwards over two of its sides.
        upwards[f] = 1 if (a < b) + (b < c) + (c < a) == 2 else -1
    order = np.arange(len(faces)).astype(np.int32)
    for corner in (2, 1, 0):
        order = counting_sort(order, corners[corner], vertex_count)
    merged = np.empty_like(faces)
    votes = np.zeros(len(faces), np.int64)
    count = 0
    for f in order:
        low, middle, high = corners[0, f], corners[1, f], corners[2, f]
        if (
            count == 0
            or low != merged[count - 1, 0]
            or middle != merged[count - 1, 1]
            or high != merged[count - 1, 2]
        ):
            write(merged, count, (low, middle, high))
            count += 1
        votes[count - 1] += upwards[f]
    return merged[:count].copy(), np.sign(votes[:count]).astype(np.int8), len(faces) - count


@kernel
def split_vertices(
    vertices: NDArray[np.float64], faces: NDArray[np.int32], twin: NDArray[np.int32]
) -> tuple[NDArray[np.float64], NDArray[np.int32], int]:
    """Give every fan of faces around a vertex a vertex of its own. Returns (.., .., copies).

    twin: H int32, with non-manifold edges left unpaired. Surfaces that touch in a corner come
    apart there; around a non-manifold edge every fan ends at that edge, so that afterwards no
    edge has more than two faces. The vertices come in the order of the corners that name them.
    """
    split = np.full((len(faces), 3), -1, np.int32)
    origin = np.empty(len(twin), np.int32)
    has_fan = np.zeros(len(vertices), np.bool_)
    count = 0
    copies = 0
    for f in range(len(faces)):
        for s in range(3):
            if split[f, s] >= 0:
                continue
            v = faces[f, s]
            origin[count] = v
            copies += has_fan[v]
            has_fan[v] = True
            split[f, s] = count
            # From face to face across both sides of the corner, to a border or once around.
            for start in (s, (s + 2) % 3):
                t = twin[3 * f + start]
                while t >= 0:
                    g, side = t // 3, t % 3
                    corner = side if faces[g, side] == v else (side + 1) % 3
                    if split[g, corner] >= 0:
                        break
                    split[g, corner] = count
                    t = twin[3 * g + ((side + 2) % 3 if corner == side else corner)]
            count += 1
    places = np.empty((count, 3))
    for v in range(count):
        write(places, v, row(vertices, origin[v]))
    return places, split, copies  # type: ignore


@kernel
def cut_one_sided(
    faces: NDArray[np.int32], twin: NDArray[np.int32], flip: NDArray[np.bool_]
) -> int:
    """Cut a one-sided surface (a Moebius strip) in place, where it runs against itself.

    flip: F bool, which faces to turn so that all others of a component run alike. Returns how many
    half-edges of `twin` have no twin any more.
    """
    cuts = 0
    for h in range(len(twin)):
        t = twin[h]
        if t >= 0:
            # Two faces wound alike run along their shared edge in opposite directions.
            opposed = faces[h // 3, h % 3] == faces[t // 3, t % 3]
            if opposed ^ flip[h // 3] ^ flip[t // 3]:
                twin[h] = -1
                cuts += 1
    return cuts


@kernel
def spread_orientation(
    faces: NDArray[np.int32], twin: NDArray[np.int32]
) -> tuple[NDArray[np.int32], NDArray[np.bool_], int]:
    """Component of every face, whether it is wound against its first face, and their number."""
    component = np.full(len(faces), -1, np.int32)
    flip = np.zeros(len(faces), np.bool_)
    queue = np.empty(len(faces), np.int32)
    count = 0
    for seed in range(len(faces)):
        if component[seed] >= 0:
            continue
        component[seed] = count
        queue[0] = seed
        head, tail = 0, 1
        while head < tail:
            f = queue[head]
            head += 1
            for s in range(3):
                t = twin[3 * f + s]
                if t < 0 or component[t // 3] >= 0:
                    continue
                g = t // 3
                component[g] = count
                flip[g] = flip[f] ^ (faces[f, s] == faces[g, t % 3])
                queue[tail] = g
                tail += 1
        count += 1
    return component, flip, count


def face_inward(
    vertices: NDArray[np.float64],
    faces: NDArray[np.int32],
    twin: NDArray[np.int32],
    component: NDArray[np.int32],
    count: int,
    winding: NDArray[np.int8],
) -> NDArray[np.bool_]:
    """Which faces (F bool) of `count` consistently wound components look inward.

    component: F int32, of each face. winding: F int8, 1 where a face is wound as in the file, -1
    where it is not. A component that is too flat to have an outside faces away from the centre of
    the whole mesh; if that lies in it, as for a single sheet, it keeps the winding of most of its
    faces.
    """
    geometry = face_geometry(vertices, faces)
    middle = surface_centroid(geometry)
    return _face_inward(geometry, middle, twin, component, count, winding)


@kernel
def _face_inward(
    geometry: FaceGeometry,
    middle: NDArray[np.float64],
    twin: NDArray[np.int32],
    component: NDArray[np.int32],
    count: int,
    winding: NDArray[np.int8],
) -> NDArray[np.bool_]:
    """`face_inward`, of measured faces; middle: the centre of the whole mesh."""
    areas = np.zeros(count)
    centres = np.zeros((count, 3))
    votes = np.zeros(count, np.int64)
    is_open = np.zeros(count, np.bool_)
    for f in range(len(component)):
        part, area = component[f], geometry.doubles[f] / 2
        areas[part] += area
        for k in range(3):
            centres[part, k] += area * (geometry.corner_sums[f, k] / 3)
            is_open[part] |= twin[3 * f + k] < 0
        votes[part] += winding[f]
    for part in range(count):
        for k in range(3):
            centres[part, k] /= areas[part]
    # Volumes that each component spans with its own centre and with the middle of the mesh.
    own, common = np.zeros(count), np.zeros(count)
    for f in range(len(component)):
        part = component[f]
        height = 0.0
        height_common = 0.0
        for k in range(3):
            centroid = geometry.corner_sums[f, k] / 3
            height += (centroid - centres[part, k]) * geometry.crosses[f, k]
            height_common += (centroid - middle[k]) * geometry.crosses[f, k]
        own[part] += height / 2
        common[part] += height_common / 2
    inward = np.empty(count, np.bool_)
    for part in range(count):
        volume, outward, unit = own[part] / 3, common[part] / 3, areas[part] ** 1.5
        if abs(volume) > (OPEN_VOLUME if is_open[part] else CLOSED_VOLUME) * unit:
            inward[part] = volume < 0
        elif abs(outward) > OPEN_VOLUME * unit:
            inward[part] = outward < 0
        else:
            inward[part] = votes[part] < 0
    return inward[component]


@kernel
def turn_faces(faces: NDArray[np.int32], twin: NDArray[np.int32], which: NDArray[np.bool_]) -> None:
    """Reverse the winding of some faces (F bool) in place: their first two sides swap."""
    if not which.any():
        return
    for f in range(len(faces)):
        if which[f]:
            faces[f, 0], faces[f, 2] = faces[f, 2], faces[f, 0]
            twin[3 * f], twin[3 * f + 1] = twin[3 * f + 1], twin[3 * f]
    for h in range(len(twin)):
        t = twin[h]
        if t >= 0 and which[t // 3] and t % 3 < 2:
            twin[h] = t + 1 - 2 * (t % 3)
