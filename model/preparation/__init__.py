"""The one way from any triangle mesh to what the network eats.

`cleaning` makes an oriented manifold, `resampling` brings it to the face budget, `report` says
what both did. Training, export checks, the command line and the service all come through here.
"""

from typing import Literal

import numpy as np
from numpy.typing import NDArray

from model.errors import UnusableMesh
from model.mesh import Mesh
from model.preparation.cleaning import clean, count_components, drop_degenerate, drop_unused
from model.preparation.report import MeshReport
from model.preparation.resampling import decimate, subdivide

__all__ = ["MeshReport", "into_unit_sphere", "prepare", "surface_area"]

# Simplification that changes the area by more than this has destroyed the shape (crumpled it, or
# swallowed its thin parts): no class can be read from what is left.
AREA_KEPT = (0.25, 2.0)


def prepare(mesh: Mesh, face_budget: int) -> tuple[Mesh, MeshReport]:
    """Clean, bring to `face_budget` faces, centre, and scale into the unit sphere.

    The result is an edge- and vertex-manifold mesh, wound alike and outward where possible; its
    face count is the budget or one less, and above it only where every further collapse would
    change the topology, as in a mesh of very many parts. Raises UnusableMesh where no surface
    with area is left, or where simplification destroyed it.
    """
    vertices, faces, counts = clean(mesh)
    clean_area = surface_area(vertices, faces)
    vertices, faces, resampled = _resample(vertices, faces, face_budget)
    area_kept = surface_area(vertices, faces) / clean_area
    if not AREA_KEPT[0] <= area_kept <= AREA_KEPT[1]:
        raise UnusableMesh(
            "lost-in-simplification",
            f"simplifying {len(mesh.faces)} faces to {face_budget} changed the surface area to "
            f"{area_kept:.0%}: the shape is too intricate (foliage, hair, many loose parts); "
            "export a simpler version of the mesh",
        )
    report = MeshReport(
        **counts,
        faces_in=len(mesh.faces),
        faces_used=len(faces),
        resampled=resampled,
        within_budget=len(faces) <= face_budget,
        components_lost=counts["components"] - count_components(faces, len(vertices)),
        area_kept=round(area_kept, 4),
    )
    return Mesh(into_unit_sphere(vertices, faces), faces), report


def _resample(
    vertices: NDArray[np.float64], faces: NDArray[np.int32], budget: int
) -> tuple[NDArray[np.float64], NDArray[np.int32], Literal["none", "decimated", "subdivided"]]:
    if len(faces) > budget:
        fewer, fewer_faces = decimate(vertices, faces, budget)
        if len(fewer_faces) == len(faces):
            return vertices, faces, "none"
        fewer, fewer_faces = drop_unused(fewer, drop_degenerate(fewer, fewer_faces)[0])
        return *subdivide(fewer, fewer_faces, budget), "decimated"
    if len(faces) < budget - 1:
        return *subdivide(vertices, faces, budget), "subdivided"
    return vertices, faces, "none"


def surface_area(vertices: NDArray[np.float64], faces: NDArray[np.int32]) -> float:
    """Total area of the triangles, in the square of the vertices' unit."""
    a, b, c = vertices[faces].transpose(1, 0, 2)
    return float(np.linalg.norm(np.cross(b - a, c - a), axis=1).sum() / 2)


def into_unit_sphere(
    vertices: NDArray[np.float64], faces: NDArray[np.int32]
) -> NDArray[np.float64]:
    """Centre the surface's centroid on the origin and the farthest vertex on the unit sphere.

    The centroid is weighted by area: that of the vertices would move with the triangulation.
    """
    a, b, c = vertices[faces].transpose(1, 0, 2)
    areas = np.linalg.norm(np.cross(b - a, c - a), axis=1)
    centred = vertices - np.average((a + b + c) / 3, axis=0, weights=areas)
    return centred / np.linalg.norm(centred, axis=1).max()
