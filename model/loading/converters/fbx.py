"""FBX to polygons by ufbx: meshes at rest, with the weights and joints that the file stores."""

import sys
from collections.abc import Sequence
from pathlib import Path
from typing import TypeVar

import numpy as np
import ufbx

Item = TypeVar("Item")

_KEPT: list = []


def read(path: Path) -> tuple:
    """Meshes, which of them are shown, and the matrices that place these."""
    scene = ufbx.load_memory(
        path.read_bytes(),
        file_format=ufbx.FileFormat.FBX,
        evaluate_skinning=True,
        ignore_embedded=True,
        index_error_handling=ufbx.IndexErrorHandling.ABORT_LOADING,
    )
    hidden = _hidden(scene)
    nodes = [node for node in _items(scene.nodes) if node.mesh and node.element_id not in hidden]  # type: ignore
    if not nodes and scene.nurbs_surfaces:
        sys.exit("the file has curved surfaces (NURBS); export them as meshes")
    numbers: dict[int, int] = {}  # of meshes, by their places in the file
    meshes = []
    for node in nodes:
        if node.mesh.typed_id not in numbers:
            numbers[node.mesh.typed_id] = len(meshes)
            meshes.append(_polygons(node.mesh))
    shown = [numbers[node.mesh.typed_id] for node in nodes]
    return meshes, shown, [_matrix(node) for node in nodes]


def _items(found: Sequence[Item]) -> list[Item]:
    """The items of one of ufbx's lists: these count one reference too few, and are never freed."""
    _KEPT.extend(found[number] for number in range(len(found)))
    return _KEPT[len(_KEPT) - len(found) :]


def _hidden(scene: ufbx.Scene) -> set[int]:
    """Nodes that are switched off, and levels of detail but the first, with all below them."""
    nodes = _items(scene.nodes)  # type: ignore
    hidden = {node.element_id for node in nodes if not node.visible}
    for group in _items(scene.lod_groups):  # type: ignore
        for holder in _items(group.instances):
            hidden |= {node.element_id for node in _items(holder.children)[1:]}
    for node in nodes:  # each follows its parent
        if node.parent is not None and node.parent.element_id in hidden:
            hidden.add(node.element_id)
    return hidden


def _polygons(mesh: ufbx.Mesh) -> tuple:
    """Vertices, corners and counts."""
    position = mesh.skinned_position
    vertices = np.array(position.values, dtype=float).reshape(-1, 3)
    corners = np.fromiter(position.indices, np.int64, len(position.indices))
    return vertices, corners, np.array(mesh.faces, dtype=np.int64).reshape(-1, 2)[:, 1]


def _matrix(node: ufbx.Node) -> np.ndarray:
    """The matrix from a mesh to the scene, 4 x 4."""
    matrix = np.eye(4)
    if node.mesh.skinned_is_local:  # type: ignore
        matrix[:3] = np.array(node.geometry_to_world).T
    return matrix
