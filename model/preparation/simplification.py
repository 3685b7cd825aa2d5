"""A quick first simplification of meshes with very many faces.

The careful one (`resampling.decimate`) takes sixteen times as long as fast-simplification, which
in turn may glue and fold what it simplifies. Far above the face budget there is room for that: what
it leaves is cleaned again, and simplified on with care.
"""

import os

import numpy as np
from numpy.typing import NDArray

from meshconv3d.model.errors import UnusableMesh
from meshconv3d.model.mesh import Mesh
from meshconv3d.model.preparation.cleaning import bounding_cube, clean, count_components
from meshconv3d.model.topology.geometry import surface_area

# Read as libigl is first used. To start threads for each mesh takes longer than they save, and
# where all cores are busy, they wait for each other.
os.environ.setdefault("IGL_NUM_THREADS", "1")

# Faces up to which care costs no more than a fifth of a second.
MOST_FACES = 20_000
# What is left, in face budgets.
ROOM = 4
# A coarse mesh whose area is farther off than this has lost parts, and is not used; nor is one that
# is torn into more parts.
AREA_KEPT = (0.9, 1.1)


def coarsen(
    vertices: NDArray[np.float64], faces: NDArray[np.int32], budget: int
) -> tuple[NDArray[np.float64], NDArray[np.int32]]:
    """A clean mesh of about ROOM times `budget` faces in the place of one with more than
    MOST_FACES. Any other is returned as it is, and so is one that this would damage."""
    if len(faces) <= MOST_FACES:
        return vertices, faces
    # fast-simplification is compiled, and loaded only where there is use for it.
    import fast_simplification

    coarse = fast_simplification.simplify(vertices, faces, target_count=ROOM * budget)
    try:
        fewer, fewer_faces = _cleaned(Mesh(*coarse[:2]))
    except UnusableMesh:
        return vertices, faces
    kept = surface_area(fewer, fewer_faces) / surface_area(vertices, faces)
    if not AREA_KEPT[0] <= kept <= AREA_KEPT[1]:
        return vertices, faces
    torn = count_components(fewer_faces, len(fewer)) > count_components(faces, len(vertices))
    return (vertices, faces) if torn else (fewer, fewer_faces)


def _cleaned(mesh: Mesh) -> tuple[NDArray[np.float64], NDArray[np.int32]]:
    """Clean, and stay in place."""
    corner, size = bounding_cube(mesh)
    vertices, faces, _ = clean(mesh)
    return vertices * size + corner, faces


def decimate(
    vertices: NDArray[np.float64], faces: NDArray[np.int32], budget: int
) -> tuple[NDArray[np.float64], NDArray[np.int32]]:
    """Quadric edge collapse from above to `budget` faces, keeping components and borders.

    The input is an edge-manifold without degenerate faces. The count can end above the budget
    where every further collapse would change the topology. libigl holds the GIL throughout, so
    calls from several threads run one after the other.
    """
    # libigl pulls in scipy: a mesh that fits its budget need not wait for that.
    import igl

    result = igl.qslim(np.asfortranarray(vertices), np.asfortranarray(faces), budget)
    return np.ascontiguousarray(result[0]), np.ascontiguousarray(result[1], dtype=np.int32)
