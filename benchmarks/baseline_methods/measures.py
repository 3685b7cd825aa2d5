"""Measures of a whole mesh: moments, box, hull, volume, parts, borders, edges and curvature."""

import numpy as np
import trimesh
from numpy.typing import NDArray

from meshconv3d.model.mesh import Mesh
from meshconv3d.model.preparation import into_unit_sphere

ANGLE_EDGES = (0, 0.05, 0.2, 0.4, 0.7, 1.0, 1.4, 1.7, 2.2, np.pi + 1e-6)
QUANTILES = (np.arange(12) + 0.5) / 12
LARGEST_PARTS = 6
# Below this share of area^1.5 a volume is rounding: a flat mesh has no hull.
LEAST_VOLUME = 1e-9


def shape_measures(mesh: Mesh) -> dict[str, NDArray[np.float64]]:
    """Every measure by name, each free of scale and of the coordinate axes."""
    # Centred, for everything below is measured from the origin; and unprocessed, since
    # trimesh's merging would change the faces.
    centred = into_unit_sphere(mesh.vertices, mesh.faces)
    solid = trimesh.Trimesh(centred, mesh.faces, process=False)
    return {
        "moments": _moments(solid),
        "hull and box": _hull_and_box(solid),
        "parts": _parts(solid),
        "topology": _topology(solid),
        "edges": _edges(solid),
        "angle defects": np.quantile(trimesh.curvature.vertex_defects(solid), QUANTILES),
    }


def _moments(solid: trimesh.Trimesh) -> NDArray[np.float64]:
    """Ratios of the principal moments of the surface, those of its normals, and its radius."""
    areas = solid.area_faces
    # A triangle's exact second moment: a quarter at its corners, three at its centroid.
    corners, middles = solid.triangles, solid.triangles_center
    second = np.einsum("f,fsi,fsj->ij", areas, corners, corners) / 12
    second += 0.75 * np.einsum("f,fi,fj->ij", areas, middles, middles)
    second /= areas.sum()
    crosses = trimesh.triangles.cross(solid.triangles)
    units = np.maximum(np.linalg.norm(crosses, axis=1), np.finfo(float).tiny)
    normals = np.einsum("fi,fj,f->ij", crosses, crosses, 1 / units) / (2 * areas.sum())
    principal = np.linalg.eigvalsh(second)[::-1]
    # Root mean square, where the farthest vertex is at 1.
    radius = np.sqrt(principal.sum())
    return np.array(
        [
            *(principal[1:] / principal[0]),
            *np.linalg.eigvalsh(normals),
            1 / radius,
            radius / np.sqrt(areas.sum()),
        ]
    )


def _hull_and_box(solid: trimesh.Trimesh) -> NDArray[np.float64]:
    """Sides of the smallest box, and how much of box and hull the mesh fills.

    The volume is that of the tetrahedra from the centroid to the triangles, as they are wound: of
    an open mesh too it does not depend on the axes, as trimesh's own would.
    """
    hull = trimesh.convex.convex_hull(solid.vertices)
    # By default it tries directions a tenth of a radian apart, and which depends on the axes.
    sides = np.sort(trimesh.bounds.oriented_bounds(hull, angle_digits=6)[1])[::-1]
    scale = solid.area**1.5
    crosses = trimesh.triangles.cross(solid.triangles)
    volume = abs(np.einsum("fi,fi->", solid.triangles_center, crosses) / 6)
    hull_volume = abs(hull.volume)
    return np.array(
        [
            *(sides[1:] / sides[0]),
            sides[0] / np.sqrt(solid.area),
            _share(hull_volume, float(np.prod(sides)), scale),
            _share(volume, hull_volume, scale),
            hull_volume / hull.area**1.5,
            volume / scale,
            solid.area / hull.area,
        ]
    )


def _share(volume: float, of: float, scale: float) -> float:
    return volume / of if of > LEAST_VOLUME * scale else 0.0


def _parts(solid: trimesh.Trimesh) -> NDArray[np.float64]:
    """How many connected parts, and the largest ones' shares of the area."""
    part = trimesh.graph.connected_component_labels(
        solid.face_adjacency, node_count=len(solid.faces)
    )
    shares = np.sort(np.bincount(part, solid.area_faces))[::-1] / solid.area
    return np.array([len(shares), *np.pad(shares, (0, LARGEST_PARTS))[:LARGEST_PARTS]])


def _topology(solid: trimesh.Trimesh) -> NDArray[np.float64]:
    """Euler characteristic, and the borders' length."""
    edges, lengths = solid.edges_sorted, solid.edges_unique_length
    uses = np.bincount(solid.edges_unique_inverse, minlength=len(lengths))
    euler = len(np.unique(edges)) - len(lengths) + len(solid.faces)
    return np.array([euler, lengths[uses == 1].sum() / np.sqrt(solid.area)])


def _edges(solid: trimesh.Trimesh) -> NDArray[np.float64]:
    """Length of inner edges, its shares by dihedral angle, and the share of convex ones."""
    ends = solid.vertices[solid.face_adjacency_edges]
    lengths = np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1)
    total = lengths.sum()
    by_angle = np.histogram(solid.face_adjacency_angles, ANGLE_EDGES, weights=lengths)[0]
    convex = lengths[solid.face_adjacency_convex].sum()
    shares = np.append(by_angle, convex)
    # Loose triangles alone have no inner edges, and so nothing to share.
    return np.append(shares / total if total else shares, total / np.sqrt(solid.area))
