"""Pooling by face collapse on half-edges (paper, section III.C).

Collapsing face f removes f and its neighbours. Every removed neighbour *bridges* its two outer
sides: the faces across them become twins, through several removed neighbours in a row where these
touch. Two faces that then share two sides are a *flap* without volume: both are removed, and the
faces across their third sides become twins.

A pass visits the faces by ascending weight (equation 5) and collapses each face whose region (the
face, its neighbours and the faces across their outer sides) is untouched in this pass. Regions of
one pass are disjoint, so that collapsing them one after the other equals collapsing them at once,
and the remaining faces, flaps included, are counted exactly.

A collapse is undone when it would empty its component or fall more than SLACK below the target.
Passes repeat until the target is met or a pass removes nothing.
"""

import numpy as np
from numpy.typing import NDArray

from meshconv3d.model.jit import kernel

# A collapse without flaps removes four faces: from one above the target it lands three below.
SLACK = 3

# A face and its neighbours; -1 for one that is not there.
Region = tuple[int, int, int, int]


@kernel
def pool_faces(
    twin: NDArray[np.int32], features: NDArray, target: int, squared: bool, literal: bool
) -> tuple[NDArray[np.int32], NDArray[np.int32], NDArray[np.int32], NDArray[np.float64]]:
    """Collapse faces until `target` are left, or as few as the surface allows.

    twin: H int32, symmetric; no face is its own neighbour, no two faces share two sides.
    features: F x C floats, what equation 5 compares, by squared or plain Euclidean distance.
    literal: follow the paper to the letter. In equation 5 a missing neighbour is the zero vector;
    in step 5 each pass replaces a survivor of a region by the mean of its neighbours in that
    region. Otherwise a missing neighbour counts as the mean of those that are there, and a
    survivor becomes the mean of itself and all removed faces that touched it, over all passes.

    Returns (kept, pooled_twin, index, shares): kept, F' int32, the surviving faces in ascending
    order; pooled_twin, 3 F' int32, their twins; index, F' x W int32 of face + 1, null-padded, the
    faces that a survivor gathers, by default itself first; shares, F' x W, the weight of each in
    the survivor's feature. The shares of a row sum to 1; unless `literal`, they are equal.
    """
    faces = len(twin) // 3
    twin = twin.copy()
    alive = np.ones(faces, np.bool_)
    offsets = np.arange(faces + 1)
    members = np.arange(faces).astype(np.int32)
    shares = np.ones(faces)
    living = faces
    while living > target:
        means = _average(features, offsets, members, shares, literal)
        weights = _weigh(twin, means, alive, squared, literal)
        order = np.flatnonzero(alive)
        order = order[np.argsort(weights[order], kind="mergesort")]  # stable
        before = twin.copy()
        touched, regions, removed = _collapse_pass(twin, alive, order, living, target)
        if removed == 0:
            break
        living -= removed
        if literal:
            touched = _neighbours_in_region(before, regions)
        offsets, members, shares = _gather_members(
            alive, touched, offsets, members, shares, literal
        )
    return _compact(twin, alive, living, offsets, members, shares)


@kernel
def _average(
    features: NDArray,
    offsets: NDArray[np.int64],
    members: NDArray[np.int32],
    shares: NDArray[np.float64],
    literal: bool,
) -> NDArray[np.float64]:
    means = np.zeros(features.shape)
    for f in range(len(features)):
        size = offsets[f + 1] - offsets[f]
        for i in range(offsets[f], offsets[f + 1]):
            m = members[i]
            for c in range(features.shape[1]):
                if literal:
                    means[f, c] += features[m, c] * shares[i]
                else:
                    means[f, c] += features[m, c] if size == 1 else features[m, c] / size
    return means


@kernel
def _weigh(
    twin: NDArray[np.int32],
    features: NDArray[np.float64],
    alive: NDArray[np.bool_],
    squared: bool,
    literal: bool,
) -> NDArray[np.float64]:
    """Equation 5: summed feature distance to the three neighbours, infinite for dead faces.

    A missing neighbour counts as the mean of those that are there, so that a border is neither
    eroded first nor kept for longest; if `literal`, as the zero vector.
    """
    weights = np.full(len(features), np.inf)
    for f in range(len(features)):
        if not alive[f]:
            continue
        total = 0.0
        present = 0
        for h in range(3 * f, 3 * f + 3):
            neighbour = twin[h] // 3
            if neighbour < 0 and not literal:
                continue
            present += 1
            distance = 0.0
            for c in range(features.shape[1]):
                other = features[neighbour, c] if neighbour >= 0 else 0.0
                distance += (features[f, c] - other) ** 2
            total += distance if squared else np.sqrt(distance)
        weights[f] = total * 3 / max(present, 1)
    return weights


@kernel
def _collapse_pass(
    twin: NDArray[np.int32],
    alive: NDArray[np.bool_],
    order: NDArray[np.int64],
    living: int,
    target: int,
) -> tuple[NDArray[np.int32], NDArray[np.int32], int]:
    """Collapse every free region in `order` until `target`; updates twin and alive.

    Returns (touched, regions, removed): touched, F x 3 int32, the removed faces that lay behind
    each side of a survivor, or -1; regions, F int32, the collapsed face whose region each face
    belongs to, or -1; removed, how many faces this pass removed.
    """
    faces = len(alive)
    regions = np.full(faces, -1, np.int32)
    touched = np.full((faces, 3), -1, np.int32)
    # Log of a collapse, to undo it: half-edges with their old twins, and removed faces.
    changed = np.empty(faces + 16, np.int32)
    old_twin = np.empty(faces + 16, np.int32)
    killed = np.empty(faces + 16, np.int32)
    total = 0
    for f in order:
        if living - total <= target:
            break
        if regions[f] >= 0:
            continue
        region = (f, twin[3 * f] // 3, twin[3 * f + 1] // 3, twin[3 * f + 2] // 3)
        if not _is_free(region, twin, regions):
            continue
        bridged = _bridge(twin, region, changed, old_twin)
        removed = 0
        for r in region:
            if r >= 0:
                alive[r] = False
                killed[removed] = r
                removed += 1
        changed_count, killed_count, emptied = _remove_flaps(
            twin, alive, changed, old_twin, bridged, killed, removed
        )
        if emptied or living - total - killed_count < target - SLACK:
            for i in range(changed_count - 1, -1, -1):
                twin[changed[i]] = old_twin[i]
            for i in range(killed_count):
                alive[killed[i]] = True
            continue
        total += killed_count
        for i in range(bridged):
            touched[changed[i] // 3, changed[i] % 3] = old_twin[i] // 3
        for i in range(changed_count):
            regions[changed[i] // 3] = f
        for i in range(killed_count):
            regions[killed[i]] = f
    return touched, regions, total


@kernel
def _neighbours_in_region(twin: NDArray[np.int32], regions: NDArray[np.int32]) -> NDArray[np.int32]:
    """The neighbours of each face that belong to the same region, or -1: F x 3 int32."""
    neighbours = np.full((len(regions), 3), -1, np.int32)
    for h in range(len(twin)):
        f, neighbour = h // 3, twin[h] // 3
        if neighbour >= 0 and regions[f] >= 0 and regions[neighbour] == regions[f]:
            neighbours[f, h % 3] = neighbour
    return neighbours


@kernel
def _is_free(region: Region, twin: NDArray[np.int32], regions: NDArray[np.int32]) -> bool:
    """Whether the region and the faces next to it are free; False for a whole component."""
    survivors = False
    for o in region[1:]:
        if o < 0:
            continue
        if regions[o] >= 0:
            return False
        for h in range(3 * o, 3 * o + 3):
            across = twin[h] // 3
            if across < 0:
                continue
            if regions[across] >= 0:
                return False
            survivors |= not _contains(region, across)
    return survivors


@kernel
def _contains(region: Region, f: int) -> bool:
    return f == region[0] or f == region[1] or f == region[2] or f == region[3]


@kernel
def _bridge(
    twin: NDArray[np.int32],
    region: Region,
    changed: NDArray[np.int32],
    old_twin: NDArray[np.int32],
) -> int:
    """Re-twin the survivors around a region through the faces that go; log the changes."""
    count = 0
    for o in region[1:]:
        if o < 0:
            continue
        for h in range(3 * o, 3 * o + 3):
            outside = twin[h]
            if outside >= 0 and not _contains(region, outside // 3):
                changed[count] = outside
                old_twin[count] = h
                count += 1
    for i in range(count):
        exit_side = _other_outer_side(twin, old_twin[i], region[0])
        while twin[exit_side] >= 0 and _contains(region, twin[exit_side] // 3):
            exit_side = _other_outer_side(twin, twin[exit_side], region[0])
        end = twin[exit_side]
        twin[changed[i]] = -1 if end // 3 == changed[i] // 3 else end
    return count


@kernel
def _other_outer_side(twin: NDArray[np.int32], h: int, centre: int) -> int:
    """The side of h's face that is neither h nor the one towards the collapsed centre."""
    first = 3 * (h // 3)
    for candidate in range(first, first + 3):
        if candidate != h and twin[candidate] // 3 != centre:
            return candidate
    return -1


@kernel
def _remove_flaps(
    twin: NDArray[np.int32],
    alive: NDArray[np.bool_],
    changed: NDArray[np.int32],
    old_twin: NDArray[np.int32],
    changed_count: int,
    killed: NDArray[np.int32],
    killed_count: int,
) -> tuple[int, int, bool]:
    """Remove flaps among the faces whose twins changed, and those that this makes, in turn.

    Extends the log of changes. Returns (changed_count, killed_count, emptied); emptied says that
    a flap has nothing behind it: its component would be gone.
    """
    next_change = 0
    while next_change < changed_count:
        g = changed[next_change] // 3
        next_change += 1
        if not alive[g]:
            continue
        partner, third = _flap_partner(twin, g)
        if partner < 0:
            continue
        _, partner_third = _flap_partner(twin, partner)
        if third < 0 or (twin[third] < 0 and twin[partner_third] < 0):
            return changed_count, killed_count, True
        behind, behind_partner = twin[third], twin[partner_third]
        alive[g] = False
        alive[partner] = False
        killed[killed_count] = g
        killed[killed_count + 1] = partner
        killed_count += 2
        # A face behind both third sides would become its own twin: it gets borders instead.
        same_face = behind // 3 == behind_partner // 3
        for h, new in ((behind, behind_partner), (behind_partner, behind)):
            if h >= 0:
                changed[changed_count] = h
                old_twin[changed_count] = twin[h]
                changed_count += 1
                twin[h] = -1 if same_face else new
    return changed_count, killed_count, False


@kernel
def _flap_partner(twin: NDArray[np.int32], g: int) -> tuple[int, int]:
    """(face that shares two sides with g, g's third half-edge).

    (-1, -1) if there is none; the half-edge is -1 where all three sides are shared.
    """
    a, b, c = twin[3 * g] // 3, twin[3 * g + 1] // 3, twin[3 * g + 2] // 3
    if a >= 0 and a == b and b == c:
        return a, -1
    if a >= 0 and a == b:
        return a, 3 * g + 2
    if b >= 0 and b == c:
        return b, 3 * g
    if c >= 0 and c == a:
        return c, 3 * g + 1
    return -1, -1


@kernel
def _gather_members(
    alive: NDArray[np.bool_],
    touched: NDArray[np.int32],
    offsets: NDArray[np.int64],
    members: NDArray[np.int32],
    shares: NDArray[np.float64],
    literal: bool,
) -> tuple[NDArray[np.int64], NDArray[np.int32], NDArray[np.float64]]:
    """Members of each survivor after a pass, without repeats, and their shares.

    A survivor takes over the members of the faces that it touched and keeps its own; if `literal`,
    it keeps its own only where it touched none.
    """
    faces = len(alive)
    new_offsets = np.empty(faces + 1, np.int64)
    # A face has at most three neighbours that take over its members.
    new_members = np.empty(3 * len(members), np.int32)
    new_shares = np.zeros(3 * len(members))
    listed_by = np.full(faces, -1, np.int32)
    place = np.empty(faces, np.int64)
    count = 0
    for f in range(faces):
        first = count
        new_offsets[f] = first
        if not alive[f]:
            continue
        own = not literal or (touched[f] < 0).all()
        sources = own + (touched[f] >= 0).sum()
        for slot in range(0 if own else 1, 4):
            source = f if slot == 0 else touched[f, slot - 1]
            if source < 0:
                continue
            for i in range(offsets[source], offsets[source + 1]):
                m = members[i]
                if listed_by[m] != f:
                    listed_by[m] = f
                    new_members[count] = m
                    place[m] = count
                    count += 1
                new_shares[place[m]] += shares[i] / sources
        if not literal:
            new_shares[first:count] = 1.0 / (count - first)
    new_offsets[faces] = count
    return new_offsets, new_members[:count], new_shares[:count]


@kernel
def _compact(
    twin: NDArray[np.int32],
    alive: NDArray[np.bool_],
    living: int,
    offsets: NDArray[np.int64],
    members: NDArray[np.int32],
    shares: NDArray[np.float64],
) -> tuple[NDArray[np.int32], NDArray[np.int32], NDArray[np.int32], NDArray[np.float64]]:
    """Number the survivors 0 to F' - 1 and pad their member lists to one width."""
    kept = np.empty(living, np.int32)
    number = np.full(len(alive), -1, np.int32)
    width = 1
    count = 0
    for f in range(len(alive)):
        if alive[f]:
            kept[count] = f
            number[f] = count
            count += 1
            width = max(width, offsets[f + 1] - offsets[f])
    pooled_twin = np.full(3 * living, -1, np.int32)
    index = np.zeros((living, width), np.int32)
    row_shares = np.zeros((living, width))
    for row in range(living):
        f = kept[row]
        for s in range(3):
            t = twin[3 * f + s]
            if t >= 0:
                pooled_twin[3 * row + s] = 3 * number[t // 3] + t % 3
        for column in range(offsets[f + 1] - offsets[f]):
            index[row, column] = members[offsets[f] + column] + 1
            row_shares[row, column] = shares[offsets[f] + column]
    return kept, pooled_twin, index, row_shares


@kernel
def gather_mean(features: NDArray, index: NDArray[np.int32]) -> NDArray:
    """Mean of the rows (F x C) that each row of a null-padded index (F' x W) names: F' x C."""
    means = np.zeros((len(index), features.shape[1]), features.dtype)
    for row in range(len(index)):
        present = 0
        for entry in index[row]:
            if entry > 0:
                present += 1
                for c in range(features.shape[1]):
                    means[row, c] += features[entry - 1, c]
        for c in range(features.shape[1]):
            means[row, c] /= present
    return means
