"""Pooling by face collapse (paper, section III.C).

To collapse a face is to merge its three corners into one vertex. The face and its neighbours lose
their area and go; the faces across the two outer sides of a neighbour become neighbours.

A face may collapse if the faces around its corners make a disc whose rim has three edges or more: a
smaller disc takes its place, and no surface is closed, opened, torn apart or joined to itself.
Counting tells: the corners have six edges more than they have neighbours, since the corners and
the vertices across the three sides are counted twice, and nothing else may be. The outside of the
surface counts as one more vertex, with an edge to every vertex of a border, so that one rule holds
everywhere.

A pass takes the faces by ascending weight (equation 5). It collapses those that may, if no corner
of theirs is a corner, or next to a corner, of a face chosen before: so the collapses of a pass do
not change each other's discs, and are carried out at once. Passes repeat until the target is met,
or no face may collapse. A collapse removes at most four faces, so that the count ends at most three
below the target.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from meshconv3d.model.jit import kernel
from meshconv3d.model.topology.halfedges import pair


class PooledFaces(NamedTuple):
    """F' surviving faces, in the order of the F faces that they were among.

    kept: F', their places among the F. faces: F' x 3 int32, their corners. twin: 3 F' int32.
    index: F' x W int32 of face + 1, null-padded: the faces that each gathers; one that it reaches
    in two ways is there twice. shares: F' x W float64, the weight of each in the survivor's
    features; a row sums to 1.
    """

    kept: NDArray[np.int64]
    faces: NDArray[np.int32]
    twin: NDArray[np.int32]
    index: NDArray[np.int32]
    shares: NDArray[np.float64]


class Rows(NamedTuple):
    """Faces with their shares, in rows of any lengths: row f is starts[f] to starts[f + 1] - 1."""

    starts: NDArray[np.int64]
    faces: NDArray[np.int32]
    shares: NDArray[np.float64]


@kernel
def pool_faces(
    faces: NDArray[np.int32],
    twin: NDArray[np.int32],
    features: NDArray,
    target: int,
    squared: bool,
    literal: bool,
) -> PooledFaces:
    """Collapse faces until `target` are left, or as few as the topology of the surface allows.

    faces: F x 3 int32, the corners of manifold triangles of one orientation; twin: H int32, see
    `find_twins`. features: F x C floats, what equation 5 compares, by squared or plain Euclidean
    distance.

    In a pass, a survivor takes over what each face that goes from beside it had gathered. Its
    features are the mean of all that it has gathered. A missing neighbour counts in equation 5 as
    the mean of those that are there, so that a border is neither eroded first nor kept longest.

    literal: follow the paper to the letter in both. A missing neighbour is the zero vector; in each
    pass the features of a face beside one that goes become the mean of those of its neighbours in
    the same region: the faces that go with it, and the faces beside these.
    """
    count = len(faces)
    faces, twin = faces.copy(), twin.copy()
    gathered = Rows(np.arange(count + 1), np.arange(count).astype(np.int32), np.ones(count))
    alive = np.arange(count)
    while len(alive) > target:
        means = _average(alive, gathered, features)
        weights = _weigh(alive, twin, means, squared, literal)
        order = alive[np.argsort(weights, kind="mergesort")]  # stable
        centres = _choose(faces, twin, alive, order, target)
        survivors = alive[centres[alive] < 0]
        if len(survivors) == len(alive):
            break
        gathered = _gather(survivors, twin, centres, gathered, literal)
        _merge(faces, twin, alive, centres)
        alive = survivors
    return _compact(faces, twin, alive, gathered)


@kernel
def _average(alive: NDArray[np.int64], gathered: Rows, features: NDArray) -> NDArray[np.float64]:
    """The features of the living faces: F x C float64, zero for others."""
    means = np.zeros(features.shape)
    for f in alive:
        for i in range(gathered.starts[f], gathered.starts[f + 1]):
            for c in range(features.shape[1]):
                means[f, c] += gathered.shares[i] * features[gathered.faces[i], c]
    return means


@kernel
def _weigh(
    alive: NDArray[np.int64],
    twin: NDArray[np.int32],
    features: NDArray[np.float64],
    squared: bool,
    literal: bool,
) -> NDArray[np.float32]:
    """Equation 5 for the living faces: summed feature distance to the three neighbours.

    As float32: the last bits of a sum depend on its order, and nothing may depend on them.
    """
    weights = np.empty(len(alive), np.float32)
    for row in range(len(alive)):
        f = alive[row]
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
        weights[row] = total * 3 / max(present, 1)
    return weights


@kernel
def _choose(
    faces: NDArray[np.int32],
    twin: NDArray[np.int32],
    alive: NDArray[np.int64],
    order: NDArray[np.int64],
    target: int,
) -> NDArray[np.int32]:
    """Choose faces to collapse, in `order`, until `target` would be left.

    Returns the collapsed face with which each face goes, F int32; -1 for those that stay.
    """
    outside = faces.max() + 1
    starts, near = _neighbours(faces, twin, alive, outside)
    centres = np.full(len(faces), -1, np.int32)
    taken = np.zeros(outside + 1, np.bool_)
    met_by = np.full(outside + 1, -1, np.int32)
    disc = np.empty(len(near), np.int32)
    living = len(alive)
    for f in order:
        if living <= target:
            break
        if taken[faces[f, 0]] or taken[faces[f, 1]] or taken[faces[f, 2]]:
            continue
        edges = 0
        vertices = 0
        for s in range(3):
            for i in range(starts[faces[f, s]], starts[faces[f, s] + 1]):
                edges += 1
                if met_by[near[i]] != f:
                    met_by[near[i]] = f
                    disc[vertices] = near[i]
                    vertices += 1
        # Three corners, and a rim of three or more.
        if edges != vertices + 6 or vertices < 6:
            continue
        for i in range(vertices):
            taken[disc[i]] = True
        centres[f] = f
        living -= 1
        for h in range(3 * f, 3 * f + 3):
            if twin[h] >= 0:
                centres[twin[h] // 3] = f
                living -= 1
    return centres


@kernel
def _neighbours(
    faces: NDArray[np.int32], twin: NDArray[np.int32], alive: NDArray[np.int64], outside: int
) -> tuple[NDArray[np.int32], NDArray[np.int32]]:
    """The vertices next to each vertex v: near[starts[v]] to near[starts[v + 1] - 1].

    A vertex of a border has `outside`, one above all numbers of vertices, among them.
    """
    pairs = np.empty((9 * len(alive), 2), np.int32)
    count = 0
    for f in alive:
        for s in range(3):
            v, w = faces[f, s], faces[f, (s + 1) % 3]
            pairs[count, 0], pairs[count, 1] = v, w
            count += 1
            if twin[3 * f + s] < 0:
                # The half-edge back is missing. A border enters and leaves each vertex once.
                pairs[count, 0], pairs[count, 1] = w, v
                pairs[count + 1, 0], pairs[count + 1, 1] = v, outside
                count += 2
    starts = np.zeros(outside + 2, np.int32)
    for v in pairs[:count, 0]:
        starts[v + 2] += 1
    for v in range(outside):
        starts[v + 2] += starts[v + 1]
    near = np.empty(count, np.int32)
    for v, w in pairs[:count]:
        near[starts[v + 1]] = w
        starts[v + 1] += 1
    return starts, near


@kernel
def _gather(
    survivors: NDArray[np.int64],
    twin: NDArray[np.int32],
    centres: NDArray[np.int32],
    gathered: Rows,
    literal: bool,
) -> Rows:
    """What each survivor of a pass has gathered after it, and the shares of that."""
    starts = np.zeros_like(gathered.starts)
    faces = np.empty(3 * len(gathered.faces), np.int32)
    shares = np.empty(3 * len(gathered.faces))
    sources = np.empty(4, np.int64)
    count = 0
    previous = -1
    for f in survivors:
        starts[previous + 1 : f + 1] = count
        previous = f
        sources[0] = f
        found = 1
        for h in range(3 * f, 3 * f + 3):
            g = twin[h] // 3
            if g >= 0 and centres[g] >= 0:
                sources[found] = g
                found += 1
        first = 0
        if literal and found > 1:
            first = 1
            for h in range(3 * f, 3 * f + 3):
                g = twin[h] // 3
                if g >= 0 and centres[g] < 0 and _is_same_region(f, g, twin, centres):
                    sources[found] = g
                    found += 1
        for source in sources[first:found]:
            for i in range(gathered.starts[source], gathered.starts[source + 1]):
                faces[count] = gathered.faces[i]
                shares[count] = gathered.shares[i] / (found - first)
                count += 1
        if not literal:
            shares[starts[f] : count] = 1 / (count - starts[f])
    starts[previous + 1 :] = count
    return Rows(starts, faces[:count], shares[:count])


@kernel
def _is_same_region(f: int, g: int, twin: NDArray[np.int32], centres: NDArray[np.int32]) -> bool:
    """Whether two survivors lie beside faces that go with the same collapse."""
    for h in range(3 * f, 3 * f + 3):
        for i in range(3 * g, 3 * g + 3):
            if twin[h] >= 0 and twin[i] >= 0:
                one, other = centres[twin[h] // 3], centres[twin[i] // 3]
                if one >= 0 and one == other:
                    return True
    return False


@kernel
def _merge(
    faces: NDArray[np.int32],
    twin: NDArray[np.int32],
    alive: NDArray[np.int64],
    centres: NDArray[np.int32],
) -> None:
    """Merge the corners of collapsed faces, and pair the faces beyond those that go."""
    merged = np.arange(faces.max() + 1)
    for f in alive:
        if centres[f] != f:
            continue
        merged[faces[f, 1]] = merged[faces[f, 2]] = faces[f, 0]
        for h in range(3 * f, 3 * f + 3):
            if twin[h] >= 0:
                neighbour, s = twin[h] // 3, twin[h] % 3
                pair(
                    twin,
                    twin[3 * neighbour + (s + 1) % 3],
                    twin[3 * neighbour + (s + 2) % 3],
                )
    for f in alive:
        for s in range(3):
            faces[f, s] = merged[faces[f, s]]


@kernel
def _compact(
    faces: NDArray[np.int32], twin: NDArray[np.int32], alive: NDArray[np.int64], gathered: Rows
) -> PooledFaces:
    """Number the living faces 0 to F' - 1, and pad what they gathered to one width."""
    number = np.empty(len(faces), np.int32)
    width = 1
    for row in range(len(alive)):
        number[alive[row]] = row
        width = max(width, gathered.starts[alive[row] + 1] - gathered.starts[alive[row]])
    pooled_twin = np.full(3 * len(alive), -1, np.int32)
    index = np.zeros((len(alive), width), np.int32)
    shares = np.zeros((len(alive), width))
    for row in range(len(alive)):
        f = alive[row]
        for s in range(3):
            t = twin[3 * f + s]
            if t >= 0:
                pooled_twin[3 * row + s] = 3 * number[t // 3] + t % 3
        start = gathered.starts[f]
        for i in range(start, gathered.starts[f + 1]):
            index[row, i - start] = gathered.faces[i] + 1
            shares[row, i - start] = gathered.shares[i]
    return PooledFaces(alive, faces[alive], pooled_twin, index, shares)


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
