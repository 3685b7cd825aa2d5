"""Parts of a mesh, which share no edge: dust, and those that a face budget has room for."""

import numpy as np
from numpy.typing import NDArray

from meshconv3d.model.preparation.cleaning import CleanSurface, drop_unused
from meshconv3d.model.topology.geometry import face_areas

# A part is dust when its area is less than this share of a mean face's at the budget, and all dust
# together is at most DUST_SHARE of the surface: specks, as scans and marching cubes leave them,
# would take faces from the shape.
DUST = 0.25
DUST_SHARE = 0.01

# A part of fewer faces is a scrap: a leaf, a blade of grass.
SCRAP_FACES = 4


def drop_dust(surface: CleanSurface, budget: int) -> CleanSurface:
    """Drop the smallest parts, if they are dust."""
    if surface.counts["components"] == 1:
        return surface
    areas = part_areas(surface)
    ascending = np.argsort(areas, kind="stable")
    sizes = areas[ascending]
    total = sizes.sum()
    dust = (sizes < DUST * total / budget) & (np.cumsum(sizes) <= DUST_SHARE * total)
    kept = np.ones(len(areas), bool)
    kept[ascending[dust]] = False
    return surface if kept.all() else keep_parts(surface, kept)


def fitting_parts(
    areas: NDArray[np.float64], sizes: NDArray[np.int64], budget: int
) -> NDArray[np.bool_]:
    """Which parts to keep so that `budget` faces do: those with most area for each face.

    sizes: the least faces that each part can be simplified to. A part with more area than all that
    fit is kept alone, even where it does not fit.
    """
    kept = np.zeros(len(areas), bool)
    least = sizes.min()
    for part in np.argsort(-areas / sizes, kind="stable"):
        if sizes[part] <= budget:
            kept[part] = True
            budget -= sizes[part]
        if budget < least:
            break
    largest = np.argmax(areas)
    if areas[largest] > areas[kept].sum():
        kept[:] = False
        kept[largest] = True
    return kept


def scrap_area(surface: CleanSurface) -> float:
    """Area of all scraps."""
    scraps = np.bincount(surface.component) < SCRAP_FACES
    return float(part_areas(surface)[scraps].sum())


def part_areas(surface: CleanSurface) -> NDArray[np.float64]:
    """Area of each part."""
    return np.bincount(surface.component, face_areas(surface.vertices, surface.faces))


def keep_parts(surface: CleanSurface, kept_parts: NDArray[np.bool_]) -> CleanSurface:
    """The surface without its other parts; `components` is the only count that is of the rest."""
    kept = kept_parts[surface.component]
    # A face that is kept has kept neighbours.
    renumbered = np.cumsum(kept) - 1
    twin = surface.twin.reshape(-1, 3)[kept].reshape(-1)
    twin = np.where(twin < 0, -1, 3 * renumbered[twin // 3] + twin % 3).astype(np.int32)
    component = (np.cumsum(kept_parts) - 1)[surface.component[kept]].astype(np.int32)
    vertices, faces = drop_unused(surface.vertices, surface.faces[kept])
    counts = {**surface.counts, "components": int(np.count_nonzero(kept_parts))}
    return CleanSurface(vertices, faces, counts, twin, component)
