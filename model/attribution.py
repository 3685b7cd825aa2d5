"""Attribution: the contribution of each face of a mesh to a score.

A score is a bias plus the mean evidence of the last level's faces, and each of those is the mean of
the faces that it gathered, level by level. So the score can be distributed backwards without loss:
the contributions of all faces and the bias sum to the score.
"""

import numpy as np
from numpy.typing import NDArray

from meshconv3d.model.jit import kernel
from meshconv3d.model.mesh import Mesh
from meshconv3d.model.topology import Surface, Topology
from meshconv3d.model.topology.geometry import (
    Vector,
    add,
    cross,
    dot,
    face_areas,
    length,
    row,
    scale,
    subtract,
    write,
)

# The least area of a face, as a share of its mesh's.
NO_AREA = 1e-15


def contributions(evidence: NDArray, topology: Topology, surface: Surface) -> NDArray[np.float64]:
    """Contribution of each face of a prepared mesh to one score, F_0 float64.

    evidence: N_L, one column of the network's output for the last level's faces; the contributions
    sum to its mean.
    """
    shares = evidence.astype(np.float64) / len(evidence)
    reached = np.ones(len(shares), bool)
    for pool, count in zip(topology.pools[::-1], topology.face_counts[-2::-1], strict=True):
        row, column = np.nonzero(pool)
        gathered = pool[row, column] - 1
        each = shares / np.count_nonzero(pool, axis=1)
        shares = np.bincount(gathered, each[row], count).astype(np.float64)
        reached = np.bincount(gathered, reached[row], count) > 0
    return _share_with_unreached(shares, reached, surface.twin)


def _share_with_unreached(
    shares: NDArray[np.float64], reached: NDArray[np.bool_], twin: NDArray[np.int32]
) -> NDArray[np.float64]:
    """Give faces that no pooled face gathered a part of their neighbours' shares.

    Such a face was collapsed and acts only through the patches around it. Ring by ring, each face
    with a share splits it equally among itself and its neighbours without one.
    """
    h = np.flatnonzero(twin >= 0)
    face, neighbour = h // 3, twin[h] // 3
    while True:
        gives = reached[face] & ~reached[neighbour]
        if not gives.any():
            return shares
        givers, takers = face[gives], neighbour[gives]
        parts = np.bincount(givers, minlength=len(shares)) + 1
        each = shares / parts
        shares = each + np.bincount(takers, each[givers], len(shares))
        reached = reached | (np.bincount(takers, minlength=len(shares)) > 0)


def onto_file(shares: NDArray[np.float64], prepared: Mesh, file: Mesh) -> NDArray[np.float64]:
    """Contribution of each face of the file, F float64, from those of the prepared mesh, F_0.

    prepared: in the coordinates of the file. Each face of the file belongs to the prepared face
    that is nearest to its centroid; a prepared face divides its share among those that belong to
    it, by area, or, where there are none, gives it to the face nearest to its own centroid. The
    sum stays the same.
    """
    owner = _nearest(_centroids(file), prepared)
    areas = face_areas(file.vertices, file.faces)
    # A face without area contributes nothing, unless its owner has no other.
    areas = np.maximum(areas, areas.sum() * NO_AREA)
    owned = np.bincount(owner, areas, len(shares))
    added = areas * (shares / np.where(owned > 0, owned, 1))[owner]
    alone = np.flatnonzero(owned == 0)
    if len(alone):
        taker = _nearest(_centroids(prepared)[alone], file)
        added += np.bincount(taker, shares[alone], len(added))
    return added


def _centroids(mesh: Mesh) -> NDArray[np.float64]:
    return mesh.vertices[mesh.faces].mean(axis=1)


def _nearest(points: NDArray[np.float64], mesh: Mesh) -> NDArray[np.int64]:
    """The face of a mesh that is nearest to each point (N x 3): N int64."""
    return _nearest_faces(points, mesh.vertices, mesh.faces)


@kernel
def _nearest_faces(
    points: NDArray[np.float64], vertices: NDArray[np.float64], faces: NDArray[np.int32]
) -> NDArray[np.int64]:
    """Measures the faces whose bounding spheres are nearer than the nearest face so far."""
    centres, radii = np.empty((len(faces), 3)), np.empty(len(faces))
    for f in range(len(faces)):
        a, b, c = row(vertices, faces[f, 0]), row(vertices, faces[f, 1]), row(vertices, faces[f, 2])
        centre = scale(add(add(a, b), c), 1 / 3)
        write(centres, f, centre)
        radii[f] = max(
            length(subtract(a, centre)), length(subtract(b, centre)), length(subtract(c, centre))
        )
    nearest = np.zeros(len(points), np.int64)
    last = 0
    for i in range(len(points)):
        point = row(points, i)
        best = np.inf
        # Points follow one another along the surface: the last face is a good first guess.
        for k in range(-1, len(faces)):
            f = last if k < 0 else k
            away = subtract(row(centres, f), point)
            if dot(away, away) <= (best + radii[f]) ** 2:
                distance = _distance(
                    point,
                    row(vertices, faces[f, 0]),
                    row(vertices, faces[f, 1]),
                    row(vertices, faces[f, 2]),
                )
                if distance < best or (distance == best and f < nearest[i]):
                    best, nearest[i] = distance, f
        last = nearest[i]
    return nearest


@kernel
def _distance(point: Vector, a: Vector, b: Vector, c: Vector) -> float:
    """Distance of a point from a triangle."""
    normal = cross(subtract(b, a), subtract(c, a))
    above = dot(normal, normal) > 0
    square = np.inf
    for start, end in ((a, b), (b, c), (c, a)):
        edge, away = subtract(end, start), subtract(point, start)
        above &= dot(cross(normal, edge), away) >= 0
        along = dot(edge, away) / max(dot(edge, edge), 1e-300)
        rest = subtract(away, scale(edge, min(max(along, 0.0), 1.0)))
        square = min(square, dot(rest, rest))
    if above:
        return abs(dot(normal, subtract(point, a))) / length(normal)
    return np.sqrt(square)
