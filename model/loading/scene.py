"""Scenes through trimesh, which is given checked bytes and no way to reach others."""

from collections.abc import Iterator
from io import BytesIO
from typing import TYPE_CHECKING

import numpy as np

from model.loading.triangles import Triangles, join

if TYPE_CHECKING:
    from trimesh import Scene


def open_scene(data: bytes, extension: str) -> "Scene":
    """The scene in `data`; `extension` is trimesh's name of the format."""
    # Lazily: importing trimesh takes long, and most formats do without.
    import trimesh
    from trimesh.resolvers import ZipResolver

    return trimesh.load_scene(
        BytesIO(data),
        file_type=extension,
        # An empty archive: with None, trimesh would look for files beside the source.
        resolver=ZipResolver({}),
        process=False,
        skip_materials=True,
    )


def flatten(scene: "Scene") -> Triangles:
    """All meshes of a scene where their nodes place them; curves and points are passed over."""
    return join(_placed(scene))


def _placed(scene: "Scene") -> Iterator[Triangles]:
    for node in scene.graph.nodes_geometry:
        matrix, name = scene.graph[node]
        geometry = scene.geometry[name]
        faces = getattr(geometry, "faces", None)
        if faces is None:
            continue
        vertices = np.asarray(geometry.vertices, dtype=np.float64)
        faces = np.asarray(faces, dtype=np.int64)
        if not np.array_equal(matrix, np.eye(4)):
            vertices = vertices @ matrix[:3, :3].T + matrix[:3, 3]
        if np.linalg.det(matrix[:3, :3]) < 0:
            faces = faces[:, ::-1]  # a mirror turns triangles inside out
        yield vertices, faces
