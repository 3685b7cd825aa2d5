"""The nodes of a glTF document: which meshes its scene places, and where."""

from typing import Any

import numpy as np

from meshconv3d.model.errors import MalformedFile
from meshconv3d.model.loading.gltf_document import Document, entries, index, item, items, reals
from meshconv3d.model.loading.limits import Limits
from meshconv3d.model.loading.scene import Matrix, within


def placed_meshes(document: Document, limits: Limits) -> list[tuple[int, Matrix]]:
    """Number and matrix of each mesh that is placed. Raises MalformedFile and LimitExceeded."""
    limits.check("geometries", len(entries(document, "nodes")))
    nodes = items(document, "nodes")
    roots = _roots(document, nodes)
    meshes = len(entries(document, "meshes"))
    if not nodes:
        # A library of meshes that nothing places: take each as it is.
        return [(number, np.eye(4)) for number in range(meshes)]
    placed: list[tuple[int, Matrix]] = []
    waiting = [(number, np.eye(4)) for number in reversed(roots)]
    while waiting:
        number, above = waiting.pop()
        node = nodes[number]
        matrix = within(above, _local(node))
        if "mesh" in node:
            placed.append((index(node["mesh"], meshes, "meshes"), matrix))
        waiting += [(child, matrix) for child in reversed(entries(node, "children"))]
    return placed


def _roots(document: Document, nodes: list[Document]) -> list[int]:
    """The roots of the scene, once all nodes are known to form trees."""
    below: list[Any] = [child for node in nodes for child in entries(node, "children")]
    for number in below:
        index(number, len(nodes), "nodes")
    if "scenes" in document:
        roots = entries(item(document, "scenes", document.get("scene", 0)), "nodes")
    else:
        inner = set(below)
        roots = [number for number in range(len(nodes)) if number not in inner]
    for number in roots:
        index(number, len(nodes), "nodes")
    if len({*below, *roots}) < len(below) + len(roots):
        raise MalformedFile(
            "bad-scene", "a node has two parents or is its own ancestor; nodes must form a tree"
        )
    return roots


def _local(node: Document) -> Matrix:
    """The node's own matrix: as it is, or of its translation, rotation and scale."""
    if "matrix" in node:
        return reals(node, "matrix", 16).reshape(4, 4).T  # stored by columns
    matrix = np.eye(4)
    if "rotation" in node:
        matrix[:3, :3] = _rotation(*reals(node, "rotation", 4))
    if "scale" in node:
        matrix[:3, :3] *= reals(node, "scale", 3)
    if "translation" in node:
        matrix[:3, 3] = reals(node, "translation", 3)
    return matrix


def _rotation(x: float, y: float, z: float, w: float) -> Matrix:
    """3 x 3, of a quaternion; of one of another length than 1, its direction."""
    length = float(np.sqrt(x * x + y * y + z * z + w * w))
    if not 1e-6 < length < 1e6:
        raise MalformedFile("bad-number", "a node's rotation is no unit quaternion")
    x, y, z, w = x / length, y / length, z / length, w / length
    return np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
            [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
            [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
        ]
    )
