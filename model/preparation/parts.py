"""Which parts of a mesh are kept: dust goes, and so does what the face budget has no room for."""

import numpy as np
from numpy.typing import NDArray

from meshconv3d.model.topology.geometry import face_areas

# Specks as scans and marching cubes leave them would take faces from the shape: a part is dust when
# its area is less than this share of a mean face's at the budget, and all dust together is at most
# DUST_SHARE of the surface.
DUST = 0.25
DUST_SHARE = 0.01
# Parts are many where a budget has less than two faces for each.
LEAST_FACES = 2


def keep_largest_parts(
    vertices: NDArray[np.float64],
    faces: NDArray[np.int32],
    component: NDArray[np.int32],
    budget: int,
) -> NDArray[np.bool_]:
    """Faces (F bool) of the parts that stay: without dust, and the largest that `budget` holds.

    component: F int32, the part of each face. Parts go by area, smallest first.
    """
    count = int(component.max()) + 1
    areas = np.bincount(component, face_areas(vertices, faces), count)
    ascending = np.argsort(areas, kind="stable")
    sizes = areas[ascending]
    total = sizes.sum()
    dust = (sizes < DUST * total / budget) & (np.cumsum(sizes) <= DUST_SHARE * total)
    dropped = int(np.count_nonzero(dust))
    if len(faces) > budget:
        dropped = max(dropped, count - budget // LEAST_FACES)
    kept = np.ones(count, bool)
    kept[ascending[:dropped]] = False
    return kept[component]
