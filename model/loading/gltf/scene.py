"""The scene of a glTF document: the surfaces that it shows, at rest, and where.

A vertex is moved by, in this order: the weights of morph targets, the joints of a skin or the
transforms of its node and of those above, and the transforms of the node's instances.
"""

import numpy as np
from numpy.typing import NDArray

from meshconv3d.model.errors import MalformedFile
from meshconv3d.model.loading.gltf.arrays import (
    Accessor,
    Buffers,
    accessor,
    decoded,
)
from meshconv3d.model.loading.gltf.document import (
    Document,
    children,
    entries,
    extension,
    index,
    item,
    items,
    natural,
    reals,
)
from meshconv3d.model.loading.gltf.surfaces import Surface, surfaces
from meshconv3d.model.loading.limits import Limits
from meshconv3d.model.loading.scene import Matrices, Matrix, Placed, within


def placed_surfaces(document: Document, buffers: Buffers, limits: Limits) -> list[Placed]:
    """Each surface that the scene shows, and where. Raises MalformedFile and LimitExceeded."""
    limits.check("geometries", len(entries(document, "nodes")))
    nodes, meshes = items(document, "nodes"), items(document, "meshes")
    if not nodes:
        # A library of meshes that nothing places: take each as it is.
        nodes, document = [{"mesh": number} for number in range(len(meshes))], {}
    parents, order = _tree(nodes)
    matrices = _matrices(nodes, parents, order)
    skins: dict[int, Matrices] = {}
    known: dict[tuple, list[Surface]] = {}
    placed: list[Placed] = []
    parts = instances = 0
    for number in _shown(document, nodes, parents, order):
        node = nodes[number]
        if "mesh" not in node:
            continue
        mesh = meshes[index(node["mesh"], len(meshes), "meshes")]
        skin = natural(node, "skin") if "skin" in node else None
        if skin is not None and skin not in skins:
            skins[skin] = _joint_matrices(item(buffers.document, "skins", skin), matrices, buffers)
        weights = tuple(reals(node if "weights" in node else mesh, "weights"))
        key = node["mesh"], skin, weights
        if key not in known:
            joints = None if skin is None else skins[skin]
            limits.check("geometries", parts + int(np.count_nonzero(weights)))
            known[key] = surfaces(mesh, buffers, weights, joints)
        parts += sum(len(each.primitives) + len(each.morphs) for each in known[key])
        limits.check("geometries", parts)
        transforms = _instance_transforms(node, buffers)
        instances += next((array.count for array in transforms.values()), 1)
        limits.check("instances", instances)
        where = within(matrices[number], _composed(transforms))
        placed += [
            (surface, where if surface.skin is None else np.eye(4)[None]) for surface in known[key]
        ]
    return placed


def _joint_matrices(skin: Document, nodes: Matrices, buffers: Buffers) -> Matrices:
    """J x 4 x 4, of each joint of a skin: from the vertices' place in the file to that at rest."""
    joints = [index(number, len(nodes), "nodes") for number in entries(skin, "joints")]
    inverse = np.eye(4)[None]
    if "inverseBindMatrices" in skin:
        stored = accessor(buffers, skin["inverseBindMatrices"], "MAT4", "f4")
        if stored.count < len(joints):
            raise MalformedFile(
                "bad-accessor", f"{len(joints)} joints have {stored.count} inverse bind matrices"
            )
        if stored.values is not None:
            values = stored.values[: len(joints)]
            inverse = decoded(values, False).reshape(-1, 4, 4).swapaxes(1, 2)
    if "bindShapeMatrix" in skin:  # of glTF 1.0
        inverse = within(inverse, reals(skin, "bindShapeMatrix", 16).reshape(4, 4).T)
    return within(nodes[joints], inverse)


def _instance_transforms(node: Document, buffers: Buffers) -> dict[str, Accessor]:
    """The transforms of a node's instances (EXT_mesh_gpu_instancing), none where it has none."""
    found = extension(node, "EXT_mesh_gpu_instancing")
    attributes = {} if found is None else children(found, "attributes")
    shapes = {
        "TRANSLATION": ("VEC3", "f4"),
        "ROTATION": ("VEC4", "f4i1i2"),
        "SCALE": ("VEC3", "f4"),
    }
    transforms = {
        name: accessor(buffers, attributes[name], *shape)
        for name, shape in shapes.items()
        if name in attributes
    }
    if len({array.count for array in transforms.values()}) > 1:
        raise MalformedFile("bad-accessor", "the transforms of instances differ in number")
    return transforms


def _composed(transforms: dict[str, Accessor]) -> Matrices:
    """N x 4 x 4, of each instance; the identity where there are no transforms."""
    count = next((array.count for array in transforms.values()), 1)
    matrices = np.tile(np.eye(4), (count, 1, 1))
    if "ROTATION" in transforms:
        matrices[:, :3, :3] = _rotations(transforms["ROTATION"].floats())
    if "SCALE" in transforms:
        matrices[:, :3, :3] *= transforms["SCALE"].floats()[:, None]
    if "TRANSLATION" in transforms:
        matrices[:, :3, 3] = transforms["TRANSLATION"].floats()
    return matrices


def _tree(nodes: list[Document]) -> tuple[list[int | None], list[int]]:
    """The parent of each node, and all nodes in an order in which each follows its parent."""
    below = [
        list(
            dict.fromkeys(index(child, len(nodes), "nodes") for child in entries(node, "children"))
        )
        for node in nodes
    ]
    parents: list[int | None] = [None] * len(nodes)
    for number, inner in enumerate(below):
        for child in inner:
            if parents[child] is not None:
                raise MalformedFile("bad-scene", "a node has two parents; nodes must form trees")
            parents[child] = number
    order = [number for number, parent in enumerate(parents) if parent is None]
    for number in order:  # which grows as it is gone through
        order += below[number]
    if len(order) < len(nodes):
        raise MalformedFile("bad-scene", "a node is its own ancestor; nodes must form trees")
    return parents, order


def _matrices(nodes: list[Document], parents: list[int | None], order: list[int]) -> Matrices:
    """N x 4 x 4, of each node within its parents."""
    matrices = np.empty((len(nodes), 4, 4))
    for number in order:
        parent, local = parents[number], _local(nodes[number])
        matrices[number] = local if parent is None else within(matrices[parent], local)
    return matrices


def _shown(
    document: Document, nodes: list[Document], parents: list[int | None], order: list[int]
) -> list[int]:
    """The nodes of the scene that are visible, each once.

    A scene should list roots alone, but some list a child too, which is drawn under its parent.
    """
    listed = {number for number in order if parents[number] is None}
    if entries(document, "scenes"):
        scene = item(document, "scenes", document.get("scene", 0))
        listed = {index(number, len(nodes), "nodes") for number in entries(scene, "nodes")}
    shown, hidden = [False] * len(nodes), [False] * len(nodes)
    for number in order:
        parent = parents[number]
        visibility = extension(nodes[number], "KHR_node_visibility") or {}
        shown[number] = number in listed or (parent is not None and shown[parent])
        hidden[number] = visibility.get("visible") is False or (
            parent is not None and hidden[parent]
        )
    return [number for number in order if shown[number] and not hidden[number]]


def _local(node: Document) -> Matrix:
    """The node's own matrix: as it is, or of its translation, rotation and scale."""
    if "matrix" in node:
        return reals(node, "matrix", 16).reshape(4, 4).T  # stored by columns
    matrix = np.eye(4)
    if "rotation" in node:
        matrix[:3, :3] = _rotations(reals(node, "rotation", 4)[None])[0]
    if "scale" in node:
        matrix[:3, :3] *= reals(node, "scale", 3)
    if "translation" in node:
        matrix[:3, 3] = reals(node, "translation", 3)
    return matrix


def _rotations(quaternions: NDArray[np.float64]) -> NDArray[np.float64]:
    """N x 3 x 3, of quaternions x, y, z, w (N x 4); of one of another length than 1, its direction.

    Raises MalformedFile where one has no direction.
    """
    lengths = np.linalg.norm(quaternions, axis=1)
    if not ((lengths > 1e-6) & (lengths < 1e6)).all():
        raise MalformedFile("bad-number", "a rotation is no unit quaternion")
    x, y, z, w = (quaternions / lengths[:, None]).T
    rows = [
        [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
        [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
        [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
    ]
    return np.moveaxis(np.array(rows), -1, 0)
