"""What preparation found in a mesh and did to it; it travels with every result."""

from dataclasses import dataclass
from typing import Literal


@dataclass(frozen=True)
class MeshReport:
    """Counts of one preparation.

    faces_in: as loaded; vertices_in: those that faces use. faces_used: what the network saw.
    vertices_merged: vertices that coincided with another. degenerate_dropped: faces without area.
    duplicates_dropped: faces over the same three vertices as another.
    nonmanifold_edges: edges with more than two faces. vertices_split: copies made where surfaces
    only touched, in an edge or a corner. flipped: faces whose winding was turned.
    components, border_edges, watertight: of the cleaned surface, before its face count changed.
    resampled: how the face count was brought to the model's budget; within_budget: whether it
    was, which very many parts can prevent. components_lost: small parts that simplification
    swallowed. area_kept: surface after resampling over surface before it.
    note: what reading the file left out or had to guess; mostly empty.
    """

    faces_in: int
    faces_used: int
    vertices_in: int
    vertices_merged: int
    degenerate_dropped: int
    duplicates_dropped: int
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
