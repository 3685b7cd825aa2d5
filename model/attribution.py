"""Where a score comes from: what each face of a mesh adds to it.

A score is a bias plus the mean of what the last level's faces say, and each of those is the mean of
faces that it gathered, level by level. So a score can be sent back the way it came, and nothing is
lost: what the faces of the mesh add, and the bias, sum to the score.
"""

import numpy as np
from numpy.typing import NDArray

from meshconv3d.model.mesh import Mesh
from meshconv3d.model.topology import Surface, Topology
from meshconv3d.model.topology.geometry import face_areas

# The least share of a mesh's area that a face is taken to have.
NO_AREA = 1e-15


def contributions(evidence: NDArray, topology: Topology, surface: Surface) -> NDArray[np.float64]:
    """What each face of a prepared mesh adds to one score, F_0 float64; the sum is its mean.

    evidence: N_L, one column of what the network says of the last level's faces.
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
    """Let faces that no pooled face gathered have a part of what their neighbours have.

    Such a face was collapsed, and speaks only through the patches of those around it. Ring by
    ring, each of these splits its share equally among itself and its neighbours without one.
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
    """What each face of the file adds, F float64, from what those of the prepared mesh do (F_0).

    prepared: in the coordinates of the file. Each face of the file belongs to the prepared face
    that is nearest to its centroid; a prepared face gives its share to those that belong to it,
    by their area, or, where there are none, to the face nearest to its own centroid. Both sum to
    the same.
    """
    owner = _nearest(_centroids(file), prepared)
    areas = face_areas(file.vertices, file.faces)
    # A face without area adds nothing, unless its owner has no other.
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
    """The face of a mesh whose surface is nearest to each point (N x 3): N int64."""
    # libigl pulls in scipy: who classifies without explaining need not wait for that.
    import igl

    faces = mesh.faces.astype(np.int64)
    return np.asarray(igl.point_mesh_squared_distance(points, mesh.vertices, faces)[1])
