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
from meshconv3d.model.preparation.shell import find_root, find_walls, join
from meshconv3d.model.topology.geometry import (
    FaceGeometry,
    bounds,
    face_areas,
    face_geometry,
    surface_centroid,
)
from meshconv3d.model.topology.halfedges import counting_sort, find_twins

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
    """

    vertices: NDArray[np.float64]
    faces: NDArray[np.int32]
    counts: dict[str, Any]
    twin: NDArray[np.int32]
    component: NDArray[np.int32]


def clean(mesh: Mesh) -> CleanSurface:
    """Weld, drop what has no area or is there twice, separate what only touches, orient.

    Vertices, faces and corners come in an order that follows from where they lie, not from the
    file: what breaks ties by order later breaks them alike however the mesh is written down. Raises
    UnusableMesh where no face has an area.
    """
    vertices, faces, merged = weld(*_into_unit_box(mesh))
    vertices_in = len(vertices) + merged
    faces, degenerate = drop_degenerate(vertices, faces)
    if len(faces) == 0:
        raise UnusableMesh(
            "no-area",
            f"none of the {len(mesh.faces)} faces has an area: all are lines or "
            "points; export the surface, in units in which it does not vanish",
        )
    faces, winding, duplicates = merge_duplicates(faces, len(vertices))
    touching, _, nonmanifold = find_twins(faces, len(vertices), False)
    walls = 0
    if nonmanifold:
        outer = ~find_walls(vertices, faces)
        walls = len(faces) - int(np.count_nonzero(outer))
        if walls:
            faces, winding = faces[outer], winding[outer]
            touching, _, _ = find_twins(faces, len(vertices), False)
    flip, touching = wind_alike(faces, touching)
    vertices, faces, copies = split_vertices(vertices, faces, touching)
    faces = turned(faces, flip)
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
    return CleanSurface(vertices, faces, counts, twin, component)


def _into_unit_box(mesh: Mesh) -> tuple[NDArray[np.float64], NDArray[np.int32]]:
    """Move the used vertices into [0, 1]^3, so that tolerances mean the same for every mesh."""
    corner, size = bounding_cube(mesh)
    return (mesh.vertices - corner) / size, mesh.faces


def bounding_cube(mesh: Mesh) -> tuple[NDArray[np.float64], float]:
    """Lowest corner, 3 float64, and side of the least cube from there around all faces."""
    low, high = bounds(mesh.vertices, mesh.faces)
    return low, float((high - low).max())


def weld(
    vertices: NDArray[np.float64], faces: NDArray[np.int32]
) -> tuple[NDArray[np.float64], NDArray[np.int32], int]:
    """Move vertices to the grid and merge those on one point; drop the ones no face uses.

    Returns (vertices, faces, merged), the vertices sorted by their coordinates. On the grid, the
    rounding of another unit or origin is gone.
    """
    vertices, corners = drop_unused(vertices, faces)
    steps = np.rint(vertices * GRID_STEPS + GRID_SHIFT).astype(np.int64)
    keys = (steps[:, 0] << (2 * GRID_BITS)) | (steps[:, 1] << GRID_BITS) | steps[:, 2]
    points, merged_into = np.unique(keys, return_inverse=True)
    places = np.stack([points >> (2 * GRID_BITS), points >> GRID_BITS, points], axis=1)
    welded = merged_into[corners].astype(np.int32)
    places &= (1 << GRID_BITS) - 1
    return places / GRID_STEPS, welded, len(keys) - len(points)


def drop_degenerate(
    vertices: NDArray[np.float64], faces: NDArray[np.int32]
) -> tuple[NDArray[np.int32], int]:
    """Drop faces that name a vertex twice or have no height. Returns (faces, dropped)."""
    sound = faces[_have_height(vertices, faces, face_areas(vertices, faces))]
    return sound, len(faces) - len(sound)


@kernel
def _have_height(
    vertices: NDArray[np.float64], faces: NDArray[np.int32], areas: NDArray[np.float64]
) -> NDArray[np.bool_]:
    """Which triangles (F) have more than FLATNESS of the area that their longest side allows."""
    sound = np.empty(len(faces), np.bool_)
    for f in range(len(faces)):
        longest = 0.0
        for s in range(3):
            u, v = faces[f, s], faces[f, (s + 1) % 3]
            square = 0.0
            for k in range(3):
                step = vertices[u, k] - vertices[v, k]
                square += step * step
            longest = max(longest, square)
        sound[f] = 2 * areas[f] > FLATNESS * longest
    return sound


def drop_unused(
    vertices: NDArray[np.float64], faces: NDArray[np.int32]
) -> tuple[NDArray[np.float64], NDArray[np.int32]]:
    """Drop the vertices that no face uses, keeping the order of the others."""
    named = np.zeros(len(vertices), bool)
    named[faces] = True
    return vertices[named], (np.cumsum(named) - 1)[faces].astype(np.int32)


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
        same = count > 0
        for k in range(3):
            same = same and corners[k, f] == merged[count - 1, k]
        if not same:
            merged[count] = corners[:, f]
            count += 1
        votes[count - 1] += upwards[f]
    return merged[:count].copy(), np.sign(votes[:count]).astype(np.int8), len(faces) - count


def split_vertices(
    vertices: NDArray[np.float64], faces: NDArray[np.int32], twin: NDArray[np.int32]
) -> tuple[NDArray[np.float64], NDArray[np.int32], int]:
    """Give every fan of faces around a vertex a vertex of its own. Returns (.., .., copies).

    twin: H int32, with non-manifold edges left unpaired. Surfaces that touch in a corner come
    apart there; around a non-manifold edge every fan ends at that edge, so that afterwards no
    edge has more than two faces.
    """
    fan = _glue_corners(faces, twin)
    # Every fan becomes a vertex, in the order of its first corner, which is its root.
    is_root = fan == np.arange(len(fan))
    split_faces = (np.cumsum(is_root) - 1)[fan].reshape(faces.shape).astype(np.int32)
    origin = faces.reshape(-1)[is_root]
    return vertices[origin], split_faces, len(origin) - int(np.count_nonzero(np.bincount(origin)))


@kernel
def _glue_corners(faces: NDArray[np.int32], twin: NDArray[np.int32]) -> NDArray[np.int32]:
    """Root corner of every corner (H int32), joining corners at one vertex across twins."""
    parent = np.arange(len(twin)).astype(np.int32)
    for h in range(len(twin)):
        t = twin[h]
        if t < h:
            continue
        f, g = h // 3, t // 3
        for corner in (h % 3, (h % 3 + 1) % 3):
            for other in (t % 3, (t % 3 + 1) % 3):
                if faces[f, corner] == faces[g, other]:
                    join(parent, 3 * f + corner, 3 * g + other)
    for corner in range(len(twin)):
        parent[corner] = find_root(parent, corner)
    return parent


def wind_alike(
    faces: NDArray[np.int32], twin: NDArray[np.int32]
) -> tuple[NDArray[np.bool_], NDArray[np.int32]]:
    """Which faces to turn so that all of a component run alike.

    Returns (flip, twin): flip, F bool; twin, the half-edges with a cut along the line where a
    one-sided surface (a Moebius strip) runs against itself.
    """
    _, flip, _ = spread_orientation(faces, twin)
    return flip, _cut_against(faces, twin, flip)


@kernel
def _cut_against(
    faces: NDArray[np.int32], twin: NDArray[np.int32], flip: NDArray[np.bool_]
) -> NDArray[np.int32]:
    """The twins without those of faces that run against each other even so."""
    cut = twin.copy()
    for h in range(len(twin)):
        t = twin[h]
        if t >= 0:
            # Two faces wound alike run along their shared edge in opposite directions.
            opposed = faces[h // 3, h % 3] == faces[t // 3, t % 3]
            if opposed ^ flip[h // 3] ^ flip[t // 3]:
                cut[h] = -1
    return cut


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
    areas, volumes, outwards = _enclosed(component, count, geometry, middle)
    borders = np.bincount(component, (twin.reshape(-1, 3) < 0).sum(axis=1), count)
    least = np.where(borders > 0, OPEN_VOLUME, CLOSED_VOLUME) * areas**1.5
    seen = np.abs(outwards) > OPEN_VOLUME * areas**1.5
    flat = np.where(seen, outwards < 0, np.bincount(component, winding, count) < 0)
    turn = np.where(np.abs(volumes) > least, volumes < 0, flat)
    return turn[component]


@kernel
def _enclosed(
    component: NDArray[np.int32], count: int, geometry: FaceGeometry, middle: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
    """(areas, volumes, outwards) of each of `count` components.

    component: F int32, of every face. volumes: spanned by the component with its own centre;
    outwards: with `middle`. Negative where it faces inward.
    """
    centroids, areas = geometry.corner_sums / 3, geometry.doubles / 2
    total = np.zeros(count)
    centres = np.zeros((count, 3))
    for f in range(len(component)):
        total[component[f]] += areas[f]
        for k in range(3):
            centres[component[f], k] += areas[f] * centroids[f, k]
    for part in range(count):
        for k in range(3):
            centres[part, k] /= total[part]
    own = np.zeros(count)
    common = np.zeros(count)
    for f in range(len(component)):
        part = component[f]
        height = 0.0
        height_common = 0.0
        for k in range(3):
            height += (centroids[f, k] - centres[part, k]) * geometry.crosses[f, k]
            height_common += (centroids[f, k] - middle[k]) * geometry.crosses[f, k]
        own[part] += height / 2
        common[part] += height_common / 2
    return total, own / 3, common / 3


def turned(faces: NDArray[np.int32], which: NDArray[np.bool_]) -> NDArray[np.int32]:
    """The faces with the winding of some (F bool) reversed."""
    return np.where(which[:, None], faces[:, ::-1], faces)


@kernel
def turn_faces(faces: NDArray[np.int32], twin: NDArray[np.int32], which: NDArray[np.bool_]) -> None:
    """Reverse the winding of whole components (F bool) in place: their first two sides swap."""
    for f in range(len(faces)):
        if which[f]:
            faces[f, 0], faces[f, 2] = faces[f, 2], faces[f, 0]
            twin[3 * f], twin[3 * f + 1] = twin[3 * f + 1], twin[3 * f]
    for h in range(len(twin)):
        t = twin[h]
        if t >= 0 and which[t // 3] and t % 3 < 2:
            twin[h] = t + 1 - 2 * (t % 3)
