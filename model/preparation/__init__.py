"""The one way from any triangle mesh to what the network eats.

`cleaning` makes an oriented manifold, `resampling` brings it to the face budget, `report` says
what both did. Training, export checks, the command line and the service all come through here.
"""

import numpy as np
from numpy.typing import NDArray

from model.errors import UnusableMesh
from model.mesh import Mesh
from model.preparation import cleaning
from model.preparation.report import MeshReport
from model.preparation.resampling import decimate, subdivide
from model.topology.halfedges import find_twins

__all__ = ["MeshReport", "into_unit_sphere", "prepare", "surface_area"]

# Simplification that changes the area by more than this has destroyed the shape (crumpled it, or
# swallowed its thin parts): no class can be read from what is left.
AREA_KEPT = (0.25, 2.0)


def prepare(mesh: Mesh, face_budget: int) -> tuple[Mesh, MeshReport]:
    """Clean, bring to `face_budget` faces, centre, and scale into the unit sphere.

    The result is an edge- and vertex-manifold mesh, wound alike and outward where possible; its
    face count is the budget or one less, and above it only where every further collapse would
    change the topology. Raises UnusableMesh where no surface with area is left, or where
    simplification destroyed it.
    """
    low = mesh.vertices[mesh.faces].min(axis=(0, 1))
    high = mesh.vertices[mesh.faces].max(axis=(0, 1))
    vertices = (mesh.vertices - low) / (high - low).max()
    vertices_in = len(np.unique(mesh.faces))
    vertices, faces, merged = cleaning.weld(vertices, mesh.faces)
    faces, degenerate = cleaning.drop_degenerate(vertices, faces)
    faces, duplicates = cleaning.drop_duplicates(faces)
    if len(faces) == 0:
        raise UnusableMesh(
            "no-area",
            f"none of the {len(mesh.faces)} faces has an area (all are lines or points)",
        )
    touching, _, nonmanifold = find_twins(faces, len(vertices), False)
    flip, touching = cleaning.wind_alike(faces, touching)
    vertices, faces, splits = cleaning.split_vertices(vertices, faces, touching)
    faces = cleaning.turned(faces, flip)
    twin, border, _ = find_twins(faces, len(vertices))
    inward, components = cleaning.face_inward(vertices, faces, twin, flip)
    faces = cleaning.turned(faces, inward)
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
        faces_in=len(mesh.faces),
        faces_used=len(faces),
        vertices_in=vertices_in,
        vertices_merged=merged,
        degenerate_dropped=degenerate,
        duplicates_dropped=duplicates,
        nonmanifold_edges=nonmanifold,
        vertices_split=splits,
        flipped=int(np.count_nonzero(flip ^ inward)),
        components=components,
        border_edges=border,
        watertight=border == 0,
        resampled=resampled,
        area_kept=round(area_kept, 4),
    )
    return Mesh(into_unit_sphere(vertices, faces), faces), report


def _resample(vertices, faces, budget):
    if len(faces) > budget:
        vertices, faces = decimate(vertices, faces, budget)
        faces, _ = cleaning.drop_degenerate(vertices, faces)
        return vertices, faces, "decimated"
    if len(faces) < budget - 1:
        return *subdivide(vertices, faces, budget), "subdivided"
    return vertices, faces, "none"


def surface_area(vertices: NDArray[np.float64], faces: NDArray[np.int32]) -> float:
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
