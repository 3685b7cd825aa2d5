"""Preparation: any triangle mesh becomes an oriented manifold of the face budget.

`cleaning` makes the manifold, `simplification` and `subdivision` bring it to the budget, and
`MeshReport` counts what they did. Training, export checks, the command line and the service all
call `prepare`.
"""

from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from meshconv3d.model.errors import UnusableMesh
from meshconv3d.model.mesh import Mesh
from meshconv3d.model.preparation.cleaning import (
    bounding_cube,
    clean,
    count_components,
    drop_degenerate,
    drop_unused,
    label_components,
)
from meshconv3d.model.preparation.parts import keep_largest_parts
from meshconv3d.model.preparation.simplification import coarsen, decimate
from meshconv3d.model.preparation.subdivision import subdivide
from meshconv3d.model.topology.geometry import (
    face_areas,
    face_geometry,
    farthest,
    surface_area,
    surface_centroid,
)

__all__ = [
    "MeshReport",
    "Placement",
    "face_areas",
    "into_unit_sphere",
    "prepare",
    "prepare_placed",
    "surface_area",
]

# Simplification that changes the area by more than this has destroyed the shape (crumpled it, or
# swallowed its thin parts): no class can be read from what is left.
AREA_KEPT = (0.25, 2.0)
# More faces than so many budgets take the topology stage and the graph seconds.
MOST_BUDGETS = 12


@dataclass(frozen=True)
class MeshReport:
    """Counts of one preparation.

    faces_in: as loaded; vertices_in: those that faces use. faces_used: what the network saw.
    vertices_merged: vertices that coincided with another. degenerate_dropped: faces without area.
    duplicates_dropped: faces over the same three vertices as another. walls_dropped: faces inside
    a closed surface, as between the cells of a volume mesh.
    nonmanifold_edges: edges with more than two faces. vertices_split: copies made where surfaces
    only touched, in an edge or a corner. flipped: faces whose winding was turned.
    components, border_edges, watertight: of the cleaned surface, before its face count changed.
    resampled: how the face count was brought to the model's budget; within_budget: whether it
    was, which many parts or holes can prevent. components_lost: small parts that were dropped or
    that simplification swallowed. area_kept: surface after all this over surface before it.
    note: what reading or simplifying left out or had to guess; mostly empty.
    """

    faces_in: int
    faces_used: int
    vertices_in: int
    vertices_merged: int
    degenerate_dropped: int
    duplicates_dropped: int
    walls_dropped: int
    nonmanifold_edges: int
    vertices_split: int
    flipped: int
    components: int
    border_edges: int
    watertight: bool
    resampled: Literal["none", "decimated", "subdivided"]
    within_budget: bool
    components_lost: int
    area_kept: float
    note: str = ""


@dataclass(frozen=True, eq=False)
class Placement:
    """Where a prepared mesh lies in its file: centre, 3 float64, and radius of the unit sphere."""

    centre: NDArray[np.float64]
    radius: float

    def into_file(self, points: NDArray[np.float64]) -> NDArray[np.float64]:
        """Points (N x 3) of the prepared mesh in the coordinates of the file."""
        return points * self.radius + self.centre


def prepare(mesh: Mesh, face_budget: int) -> tuple[Mesh, MeshReport]:
    """Clean, bring to `face_budget` faces, centre, and scale into the unit sphere.

    The result is an edge- and vertex-manifold mesh, wound alike and outward where possible; its
    face count is the budget or one less, and above it only where every further collapse would
    change the topology, as in a mesh of very many parts. Raises UnusableMesh where no surface
    with area is left, or where simplification destroyed it.
    """
    prepared, report, _ = prepare_placed(mesh, face_budget)
    return prepared, report


def prepare_placed(mesh: Mesh, face_budget: int) -> tuple[Mesh, MeshReport, Placement]:
    """What `prepare` makes of a mesh, and where in the file it lies."""
    clean_vertices, clean_faces, counts = clean(mesh)
    parts = counts["components"]
    vertices, faces = clean_vertices, clean_faces
    if parts > 1:
        component, _ = label_components(faces, len(vertices))
        kept = keep_largest_parts(vertices, faces, component, face_budget)
        vertices, faces = drop_unused(vertices, faces[kept])
    vertices, faces, resampled = _resample(vertices, faces, face_budget)
    area_kept, parts_left, note = 1.0, parts, mesh.note
    if resampled != "none" or len(faces) < len(clean_faces):
        area_kept = surface_area(vertices, faces) / surface_area(clean_vertices, clean_faces)
        parts_left = count_components(faces, len(vertices))
    if not AREA_KEPT[0] <= area_kept <= AREA_KEPT[1]:
        raise UnusableMesh(
            "lost-in-simplification",
            f"simplifying {len(mesh.faces)} faces to {face_budget} changed the surface area to "
            f"{area_kept:.0%}: the shape is too intricate (foliage, hair, many loose parts); "
            "export a simpler version of the mesh",
        )
    if len(faces) > MOST_BUDGETS * face_budget:
        raise UnusableMesh(
            "lost-in-simplification",
            f"{len(mesh.faces)} faces cannot be simplified below {len(faces)} without changing the "
            f"topology, and the model takes {face_budget}: the surface has too many holes or "
            "borders; export a simpler version of the mesh",
        )
    if parts_left > parts:
        note = f"{note}; " * bool(note) + f"simplification split {parts} parts into {parts_left}"
    report = MeshReport(
        **counts,
        faces_in=len(mesh.faces),
        faces_used=len(faces),
        resampled=resampled,
        within_budget=len(faces) <= face_budget,
        components_lost=max(0, parts - parts_left),
        area_kept=round(area_kept, 4),
        note=note,
    )
    centre, radius = _sphere(vertices, faces)
    corner, size = bounding_cube(mesh)
    placement = Placement(corner + size * centre, size * radius)
    return Mesh((vertices - centre) / radius, faces), report, placement


def _resample(
    vertices: NDArray[np.float64], faces: NDArray[np.int32], budget: int
) -> tuple[NDArray[np.float64], NDArray[np.int32], Literal["none", "decimated", "subdivided"]]:
    if len(faces) > budget:
        fewer, fewer_faces = decimate(*coarsen(vertices, faces, budget), budget)
        if len(fewer_faces) == len(faces):
            return vertices, faces, "none"
        fewer, fewer_faces = drop_unused(fewer, drop_degenerate(fewer, fewer_faces)[0])
        return *subdivide(fewer, fewer_faces, budget), "decimated"
    if len(faces) < budget - 1:
        return *subdivide(vertices, faces, budget), "subdivided"
    return vertices, faces, "none"


def into_unit_sphere(
    vertices: NDArray[np.float64], faces: NDArray[np.int32]
) -> NDArray[np.float64]:
    """Centre the surface's centroid on the origin and the farthest vertex on the unit sphere."""
    centre, radius = _sphere(vertices, faces)
    return (vertices - centre) / radius


def _sphere(
    vertices: NDArray[np.float64], faces: NDArray[np.int32]
) -> tuple[NDArray[np.float64], float]:
    """Centroid of the surface and distance of the farthest vertex from it.

    The centroid is weighted by area: that of the vertices would move with the triangulation.
    """
    centre = surface_centroid(face_geometry(vertices, faces))
    return centre, farthest(vertices, centre)
