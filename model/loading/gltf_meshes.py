"""The meshes of a glTF document, as surfaces that are known to lie in its buffers."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from meshconv3d.model.errors import MalformedFile
from meshconv3d.model.loading.gltf_accessors import Accessor, indices, positions
from meshconv3d.model.loading.gltf_buffers import Buffers
from meshconv3d.model.loading.gltf_document import Document, children, items, natural
from meshconv3d.model.loading.triangles import Triangles, coordinates

_TRIANGLES, _STRIP, _FAN = 4, 5, 6


@dataclass(frozen=True)
class Primitive:
    """Triangles over some positions. corners: their indices, or None for one after another."""

    mode: int
    count: int
    corners: Accessor | None

    @property
    def faces(self) -> int:
        return self.count // 3 if self.mode == _TRIANGLES else max(self.count - 2, 0)

    def read(self, buffers: Buffers) -> NDArray[np.int64]:
        """F x 3."""
        if self.corners is None:
            corners = np.arange(self.count)
        else:
            corners = self.corners.read(buffers)[:, 0].astype(np.int64)
        if self.mode == _TRIANGLES:
            return corners.reshape(-1, 3)
        step = np.arange(self.faces)
        if self.mode == _FAN:
            return corners[np.stack([0 * step, step + 1, step + 2], axis=1)]
        # In a strip every other triangle is wound the other way.
        odd = step % 2
        return corners[np.stack([step + odd, step + 1 - odd, step + 2], axis=1)]


@dataclass(frozen=True)
class Surface:
    """The primitives of a mesh that share their positions."""

    buffers: Buffers
    positions: Accessor
    primitives: tuple[Primitive, ...]

    @property
    def vertex_count(self) -> int:
        return self.positions.count

    @property
    def face_count(self) -> int:
        return sum(primitive.faces for primitive in self.primitives)

    def read(self) -> Triangles:
        faces = [primitive.read(self.buffers) for primitive in self.primitives]
        vertices = coordinates(self.positions.read(self.buffers))
        return vertices, np.concatenate(faces)


def surfaces(mesh: Document, document: Document, buffers: Buffers) -> list[Surface]:
    """The surfaces of a mesh; points and lines are passed over. Raises MalformedFile."""
    shared: dict[int, tuple[Accessor, list[Primitive]]] = {}
    for entry in items(mesh, "primitives"):
        mode = natural(entry, "mode", _TRIANGLES)
        attributes = children(entry, "attributes")
        if mode not in (_TRIANGLES, _STRIP, _FAN) or "POSITION" not in attributes:
            continue
        number = natural(attributes, "POSITION")
        if number not in shared:
            shared[number] = positions(document, number), []
        corners = indices(document, entry["indices"]) if "indices" in entry else None
        count = (corners or shared[number][0]).count
        if mode == _TRIANGLES and count % 3:
            raise MalformedFile(
                "bad-face", f"a list of triangles has {count} corners, no multiple of three"
            )
        shared[number][1].append(Primitive(mode, count, corners))
    return [Surface(buffers, found, tuple(primitives)) for found, primitives in shared.values()]
