"""Every input of an exported graph from a prepared mesh, in NumPy alone; see docs/onnx-file.md.

It is written to be read and translated: the package's own kernels do the same two hundred times as
fast. vertices: V x 3 float64; faces: F x 3 int.
"""

import numpy as np


def graph_inputs(vertices, faces, absolute, invariants, size=10, targets=(400, 300, 200)):
    """All inputs of the graph, by name, for one prepared mesh."""
    twin = find_twins(faces)
    terms = [descriptor_terms(vertices, faces, twin, absolute)]
    terms += [integral_invariants(vertices, faces)] if invariants else []
    inputs = {"terms": np.concatenate(terms, 1).astype(np.float32)}
    corners, centroids, normals, _ = measure(vertices, faces)
    lengths = np.linalg.norm(corners - np.roll(corners, -1, 1), axis=2).reshape(-1)
    features = np.append(centroids, normals, 1).astype(np.float32)
    for level, target in enumerate(targets):
        inputs[f"patches_{level}"] = grow_patches(twin, lengths, size)
        kept, faces, twin, gathered = pool_faces(faces, twin, features, target)
        lengths = lengths.reshape(-1, 3)[kept].reshape(-1)
        features = np.array([features[g].mean(0) for g in gathered])
        pools = np.zeros((len(gathered), max(map(len, gathered))), np.int32)
        for row, each in zip(pools, gathered, strict=True):
            row[: len(each)] = np.array(each) + 1
        inputs[f"pools_{level}"] = pools
    inputs["readout"] = np.arange(1, len(faces) + 1, dtype=np.int32)[None]
    return inputs


def find_twins(faces):
    """For half-edge h = 3 f + s, side s of face f, the half-edge across it, or -1 on a border."""
    sides = np.stack((faces, np.roll(faces, -1, 1)), 2).reshape(-1, 2).tolist()
    number = {(u, v): h for h, (u, v) in enumerate(sides)}
    return np.array([number.get((v, u), -1) for u, v in sides])


def descriptor_terms(vertices, faces, twin, absolute):
    """The first 21 columns of `terms`."""
    corners, centroids, normals, _ = measure(vertices, faces)
    around = np.zeros((len(vertices), 4))
    np.add.at(around, faces, np.append(normals, np.ones((len(faces), 1)), 1)[:, None])
    vertex_normals = around[:, :3] / np.maximum(around[:, 3:], 1)

    def flat(x):  # the part of a vector in the plane of its face
        return x - normals * (x * normals).sum(1, keepdims=True)

    offsets = corners - centroids[:, None]
    farthest = offsets[np.arange(len(faces)), (offsets**2).sum(2).argmax(1)]
    tangents = flat(centroids)
    short = np.linalg.norm(tangents, axis=1) < 1e-3
    tangents[short] = flat(farthest)[short]
    tangents /= np.maximum(np.linalg.norm(tangents, axis=1, keepdims=True), 1e-3)
    axes = np.stack((normals, tangents, np.cross(normals, tangents)), 1)

    def along(x):  # components along the axes of the face
        return np.einsum("fij,f...j->f...i", axes, x)

    there = (twin >= 0).reshape(-1, 3, 1)
    across = np.where(twin < 0, 0, twin)
    others = across.reshape(-1, 3) // 3
    apexes = vertices[faces.reshape(-1)[across // 3 * 3 + (across + 2) % 3]].reshape(-1, 3, 3)
    both, step = there & np.roll(there, 1, 1), apexes - np.roll(apexes, 1, 1)
    terms = (
        (np.abs(along(offsets)) if absolute else along(offsets)).sum(1),
        along(vertex_normals[faces].sum(1)),
        (np.abs(along(step)) * both).sum(1),
        along(centroids),
        along(normals),
        (np.abs(along(centroids[:, None] - centroids[others])) * there).sum(1),
        (np.abs(along(np.cross(normals[:, None], normals[others]))) * there).sum(1),
    )
    return np.concatenate(terms, 1)


def measure(vertices, faces):
    """Corners (F x 3 x 3), centroids and unit normals (F x 3), and areas (F)."""
    corners = vertices[faces]
    cross = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    double = np.linalg.norm(cross, axis=1)
    return corners, corners.sum(1) / 3, cross / np.maximum(double, 1e-300)[:, None], double / 2


def integral_invariants(vertices, faces):
    """The other 47 columns of `terms`, of models with `integral_invariants`."""
    corners, centroids, normals, areas = measure(vertices, faces)
    cuts = np.ceil(np.sqrt(areas / areas.sum() * 100)).astype(int)  # a face in n * n triangles
    points, weights, owner = [], [], []
    for f, n in enumerate(cuts):
        for p, q in [(row, place) for row in range(n) for place in range(n - row)]:
            for third in (1, 2)[: 2 if q < n - p - 1 else 1]:
                u, v = (p + third / 3) / n, (q + third / 3) / n
                points.append([1 - u - v, u, v] @ corners[f])
                weights.append(areas[f] / n**2)
                owner.append(f)
    points, weights, facing = np.array(points), np.array(weights), normals[owner]
    x = points - centroids[:, None]  # F x P x 3
    squares = (x**2).sum(2)
    columns = []
    for radius in (0.1, 0.2, 0.4, 0.8, np.inf):
        inside = weights * (squares <= radius**2)
        radius = min(radius, 2.0)
        area = inside.sum(1)
        share = inside / np.maximum(area, 1e-300)[:, None]
        mean = np.einsum("fp,fpi->fi", share, x)
        covariance = np.einsum("fp,fpi,fpj->fij", share, x, x) - mean[:, :, None] * mean[:, None]
        spread = np.sqrt(np.maximum(np.linalg.eigvalsh(covariance)[:, ::-1], 0)) / radius
        heights = np.abs(np.einsum("fpi,fi->fp", x, normals)) / radius
        likeness = np.abs(normals @ facing.T)
        turned = np.einsum("fpi,pi->fp", x, facing) ** 2 / np.maximum(squares, 1e-12)
        means = [(share * each).sum(1) for each in (heights, likeness, turned)]
        log_area = np.log1p(area / (np.pi * radius**2))
        length = np.linalg.norm(mean, axis=1) / radius
        columns += [np.where(area > 0, c, 0) for c in (log_area, *spread.T, length, *means)]
    middle = weights @ points / weights.sum()
    covariance = (weights * (points - middle).T) @ (points - middle)
    covariance /= np.trace(covariance)
    c, n = centroids - middle, normals
    cc, cn = c @ covariance, n @ covariance

    def dot(a, b):
        return (a * b).sum(1)

    columns += [np.sqrt(dot(c, c)), np.abs(dot(c, n)), np.sqrt(np.maximum(dot(c, cc), 0))]
    columns += [np.sqrt(dot(cc, cc)), dot(n, cn), np.sqrt(dot(cn, cn)), np.abs(dot(c, cn))]
    return np.stack(columns, 1)


def grow_patches(twin, lengths, size):
    """Each face, its neighbours, theirs, ..., as face + 1: F x K; 0 where there are no more."""
    keys = np.where(twin < 0, np.inf, lengths + lengths[twin]).reshape(-1, 3)
    neighbours = np.where(twin < 0, 0, twin // 3 + 1).reshape(-1, 3)
    neighbours = np.take_along_axis(neighbours, keys.argsort(1, kind="stable"), 1).tolist()
    patches = np.zeros((len(neighbours), size), np.int32)
    for f in range(len(neighbours)):
        patch = [f + 1]
        for g in patch:  # which grows meanwhile
            patch += [n for n in neighbours[g - 1] if n and n not in patch]
            if len(patch) >= size:
                break
        patches[f, : len(patch)] = patch[:size]
    return patches


def pool_faces(faces, twin, features, target):
    """Collapse faces until `target` are left. The faces that stay, the surface, and what each has
    gathered, as lists of faces."""
    faces, twin = faces.copy(), twin.copy()
    gathered = [[f] for f in range(len(faces))]
    alive, outside = np.arange(len(faces)), -1
    while len(alive) > target:
        means = np.array([(features[g] / np.float64(len(g))).sum(0) for g in gathered])
        apart = ((means[:, None] - means[twin.reshape(-1, 3) // 3]) ** 2).sum(2)
        there = (twin >= 0).reshape(-1, 3)
        weights = (apart * there).sum(1) * 3 / np.maximum(there.sum(1), 1)
        near = {v: [] for v in faces[alive].reshape(-1)}
        for h in (3 * alive[:, None] + np.arange(3)).reshape(-1):
            v, w = faces[h // 3, h % 3], faces[h // 3, (h + 1) % 3]
            near[v].append(w)
            if twin[h] < 0:
                near[w].append(v)
                near[v].append(outside)
        goes, taken, left = {}, set(), len(alive)
        for f in alive[weights[alive].astype(np.float32).argsort(kind="stable")]:
            if left <= target:
                break
            rings = [near[v] for v in faces[f]]
            disc = set().union(*rings)
            if taken.isdisjoint(faces[f]) and sum(map(len, rings)) == len(disc) + 6 >= 12:
                taken |= disc
                gone = [f, *(t // 3 for t in twin[3 * f : 3 * f + 3] if t >= 0)]
                goes |= dict.fromkeys(gone, f)
                left -= len(gone)
        if not goes:
            break
        alive = np.array([f for f in alive if f not in goes])
        before = gathered.copy()
        for f in alive:
            beside = [t // 3 for t in twin[3 * f : 3 * f + 3] if t >= 0 and t // 3 in goes]
            gathered[f] = [each for g in (f, *beside) for each in before[g]]
        for f in set(goes.values()):
            for t in twin[3 * f : 3 * f + 3].copy():
                if t >= 0:
                    beyond = [twin[t // 3 * 3 + (t + i) % 3] for i in (1, 2)]
                    for one, other in (beyond, beyond[::-1]):
                        if one >= 0:
                            twin[one] = other
            faces[np.isin(faces, faces[f, 1:])] = faces[f, 0]
    number = np.zeros(len(faces), int)
    number[alive] = np.arange(len(alive))
    twin = twin.reshape(-1, 3)[alive].reshape(-1)
    twin = np.where(twin < 0, -1, 3 * number[twin // 3] + twin % 3)
    return alive, faces[alive], twin, [gathered[f] for f in alive]
