"""Parts of a mesh, which share no edge: dust, and those that a face budget has room for."""

import numpy as np
from numpy.typing import NDArray

from meshconv3d.model.jit import kernel
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
            budget -= sizes[part]  # type: ignore
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
    areas = face_areas(surface.vertices, surface.faces)
    return np.bincount(surface.component, areas).astype(np.float64, copy=False)


def keep_parts(surface: CleanSurface, kept_parts: NDArray[np.bool_]) -> CleanSurface:
    """The surface without its other parts; `components` is the only count that is of the rest."""
    faces, twin, component = _keep_parts(surface.faces, surface.twin, surface.component, kept_parts)
    vertices, faces = drop_unused(surface.vertices, faces)
    counts = {**surface.counts, "components": int(np.count_nonzero(kept_parts))}
    return surface._replace(
        vertices=vertices, faces=faces, counts=counts, twin=twin, component=component
    )


@kernel
def _keep_parts(
    faces: NDArray[np.int32],
    twin: NDArray[np.int32],
    component: NDArray[np.int32],
    kept_parts: NDArray[np.bool_],
) -> tuple[NDArray[np.int32], NDArray[np.int32], NDArray[np.int32]]:
    """(faces, twin, component) of the parts that are kept, renumbered."""
    parts = np.cumsum(kept_parts) - 1
    places = np.empty(len(faces), np.int32)
    count = 0
    for f in range(len(faces)):
        if kept_parts[component[f]]:
            places[f] = count
            count += 1
    kept_faces = np.empty((count, 3), np.int32)
    kept_twin = np.empty(3 * count, np.int32)
    kept_component = np.empty(count, np.int32)
    for f in range(len(faces)):
        if not kept_parts[component[f]]:
            continue
        g = places[f]
        kept_component[g] = parts[component[f]]
        for s in range(3):
            t = twin[3 * f + s]
            kept_faces[g, s] = faces[f, s]
            # A face that is kept has kept neighbours.
            kept_twin[3 * g + s] = 3 * places[t // 3] + t % 3 if t >= 0 else -1
    return kept_faces, kept_twin, kept_component
