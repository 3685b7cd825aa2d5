"""COLLADA to polygons by pycollada: geometries, skinned ones in the shape that is bound."""

import re
import sys
from io import BytesIO
from itertools import chain, islice
from pathlib import Path
from xml.etree import ElementTree

import numpy as np

sys.modules["lxml"] = None  # type: ignore[assignment]  # so that the standard parser is used
import collada  # noqa: E402
from collada.polylist import Polylist  # noqa: E402
from collada.triangleset import TriangleSet  # noqa: E402

_MOST = 250_000  # instances
# Passed over: a fault in these must not cost the shape.
_OTHER = {
    *("library_animations", "library_animation_clips", "library_cameras", "library_effects"),
    *("library_images", "library_lights", "library_materials", "library_force_fields"),
    *("library_physics_materials", "library_physics_models", "library_physics_scenes", "extra"),
    *("bind_material", "instance_camera", "instance_light", "instance_physics_scene"),
}


def read(path: Path) -> tuple:
    """Meshes, which of them are shown, and the matrices that place these."""
    data = path.read_bytes()
    if re.search(rb"<!(DOCTYPE|ENTITY)", data):
        sys.exit("the file has a document type, which may refer to other files")
    # UTF-16 has become UTF-8.
    data = re.sub(rb"""(<\?xml[^>]*encoding=["'])utf-16[^"']*""", rb"\1utf-8", data, flags=re.I)
    root = ElementTree.fromstring(data)
    for parent in root.iter():
        for child in list(parent):
            if child.tag.rpartition("}")[2] in _OTHER:
                parent.remove(child)
    document = collada.Collada(BytesIO(ElementTree.tostring(root)))
    if document.scene is None:
        sys.exit("the file has no scene; export it with one")
    found = chain(*map(document.scene.objects, ("geometry", "controller")))
    numbers: dict[int, int] = {}  # of meshes, by their geometries
    meshes, shown, matrices = [], [], []
    for bound in islice(found, _MOST + 1):
        bound = getattr(bound, "geometry", bound)  # of a skin
        geometry = bound.original
        if not hasattr(geometry, "primitives"):
            sys.exit("the file has morph targets, which are not read; export it without")
        if id(geometry) not in numbers:
            numbers[id(geometry)] = len(meshes)
            meshes.append(_polygons(geometry))
        shown.append(numbers[id(geometry)])
        matrices.append(bound.matrix)
    return meshes, shown, matrices


def _polygons(geometry: collada.geometry.Geometry) -> tuple:
    """Vertices, corners and counts."""
    vertices, corners, counts = [np.empty((0, 3))], [[]], [[]]
    for primitive in geometry.primitives:
        if not isinstance(primitive, Polylist | TriangleSet) or not len(primitive):
            continue  # lines
        is_list = isinstance(primitive, Polylist)
        counts.append(primitive.vcounts if is_list else np.full(len(primitive), 3))  # type: ignore
        corners.append(primitive.vertex_index.reshape(-1) + sum(map(len, vertices)))
        vertices.append(primitive.vertex)
    return np.concatenate(vertices), np.concatenate(corners), np.concatenate(counts)
