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
from meshconv3d.model.preparation.cleaning import CleanSurface, clean
from meshconv3d.model.preparation.parts import (
    drop_dust,
    fitting_parts,
    keep_parts,
    part_areas,
    scrap_area,
)
from meshconv3d.model.preparation.simplification import simplify
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
# swallowed its thin parts): no class can be read from what is left. Dropped scraps do not count:
# others like them are left, as of the leaves of a tree.
AREA_KEPT = (0.15, 2.0)
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
    was, which many handles or holes can prevent. components_lost: small parts that were dropped,
    as dust or for the budget. area_kept: surface after all this over surface before it.
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
    """Clean, bring to `face_budget` faces, centre, scale into the unit sphere, round to float32.

    The result is an edge- and vertex-manifold mesh, wound alike and outward where possible; its
    face count is the budget or one less, and above it only where every further collapse would
    change the topology of a single part with many handles or holes. Raises UnusableMesh where no
    surface with area is left, or where simplification destroyed it.
    """
    prepared, report, _ = prepare_placed(mesh, face_budget)
    return prepared, report


def prepare_placed(mesh: Mesh, face_budget: int) -> tuple[Mesh, MeshReport, Placement]:
    """What `prepare` makes of a mesh, and where in the file it lies."""
    surface = clean(mesh)
    parts = surface.counts["components"]
    dusted = drop_dust(surface, face_budget)
    vertices, faces, resampled, left = _resample(dusted, face_budget)
    parts_left = left.counts["components"]
    dropped = dusted.counts["components"] - parts_left
    area_kept = shape_kept = 1.0
    if resampled != "none" or len(faces) < len(surface.faces):
        area, before = surface_area(vertices, faces), surface_area(surface.vertices, surface.faces)
        area_kept = shape_kept = area / before
        if dropped:
            shape_kept = area / (before - scrap_area(dusted) + scrap_area(left))
    if not AREA_KEPT[0] <= shape_kept <= AREA_KEPT[1]:
        raise UnusableMesh(
            "lost-in-simplification",
            f"simplifying {len(mesh.faces)} faces to {face_budget} changed the surface area to "
            f"{shape_kept:.0%}: the shape is too intricate (folds, hair, many loose parts); "
            "export a simpler version of the mesh",
        )
    if len(faces) > MOST_BUDGETS * face_budget:
        raise UnusableMesh(
            "lost-in-simplification",
            f"{len(mesh.faces)} faces cannot be simplified below {len(faces)} without changing the "
            f"topology, and the model takes {face_budget}: the surface has too many holes or "
            "borders; export a simpler version of the mesh",
        )
    note = mesh.note
    if dropped:
        note += "; " * bool(note) + f"{dropped} of {parts} parts were dropped"
    report = MeshReport(
        **surface.counts,
        faces_in=len(mesh.faces),
        faces_used=len(faces),
        resampled=resampled,
        within_budget=len(faces) <= face_budget,
        components_lost=parts - parts_left,
        area_kept=round(area_kept, 4),
        note=note,
    )
    centre, radius = _sphere(vertices, faces)
    placement = Placement(surface.corner + surface.size * centre, surface.size * radius)
    # float32, in which other runtimes take it: equal weights of faces, which are frequent, else
    # part in another way there.
    placed = ((vertices - centre) / radius).astype(np.float32)
    return Mesh(placed, faces), report, placement


def _resample(
    surface: CleanSurface, budget: int
) -> tuple[
    NDArray[np.float64], NDArray[np.int32], Literal["none", "decimated", "subdivided"], CleanSurface
]:
    """Bring a surface to the budget. Returns (vertices, faces, how, the surface without the parts
    that were dropped)."""
    vertices, faces, counts, twin, component, *_ = surface
    how, parts = "none", counts["components"]
    if len(faces) > budget:
        vertices, faces, origin = simplify(vertices, faces, twin, budget)
        if len(faces) > budget and parts > 1:
            sizes = np.bincount(component[origin])
            kept = fitting_parts(part_areas(surface), sizes, budget)
            # Once more without the others: faces that these took are there for the rest.
            return _resample(keep_parts(surface, kept), budget)
        if len(faces) < len(surface.faces):
            how = "decimated"
    if len(faces) < budget - 1:
        vertices, faces = subdivide(vertices, faces, budget)
        if how == "none":
            how = "subdivided"
    return vertices, faces, how, surface


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
