"""The surfaces of a glTF mesh, with what moves their vertices."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from meshconv3d.model.errors import MalformedFile
from meshconv3d.model.loading.gltf.arrays import (
    DRACO,
    Accessor,
    Array,
    Buffers,
    accessor,
    draco_attribute,
)
from meshconv3d.model.loading.gltf.document import (
    Document,
    children,
    extension,
    items,
    natural,
    unsupported,
)
from meshconv3d.model.loading.scene import Matrices
from meshconv3d.model.loading.text import quoted
from meshconv3d.model.loading.triangles import Triangles

_TRIANGLES, _STRIP, _FAN = 4, 5, 6
_POSITIONS = "i1u1i2u2f4"  # integers: KHR_mesh_quantization
_SETS = 4  # of joints and weights, four of each in a set
_ROWS = 2**16  # vertices that are moved by their joints at once


@dataclass(frozen=True)
class Primitive:
    """Triangles over some positions. corners: their indices, or None for one after another."""

    mode: int
    count: int
    corners: Array | None

    @property
    def faces(self) -> int:
        return self.count // 3 if self.mode == _TRIANGLES else max(self.count - 2, 0)

    def read(self) -> NDArray[np.int64]:
        """F x 3."""
        if self.corners is None:
            corners = np.arange(self.count)
        else:
            corners = self.corners.read()[:, 0].astype(np.int64)
        if self.mode == _TRIANGLES:
            return corners.reshape(-1, 3)
        step = np.arange(self.faces)
        if self.mode == _FAN:
            return corners[np.stack([0 * step, step + 1, step + 2], axis=1)]
        # In a strip every other triangle is wound the other way.
        odd = step % 2
        return corners[np.stack([step + odd, step + 1 - odd, step + 2], axis=1)]


@dataclass(frozen=True)
class Skin:
    """What moves vertices with joints.

    matrices: J x 4 x 4, of each joint, for what follows it alone.
    joints, weights: four of each a vertex in each array.
    """

    matrices: Matrices
    joints: Sequence[Array]
    weights: Sequence[Array]

    def moved(self, vertices: NDArray[np.float64]) -> NDArray[np.float64]:
        """The vertices, V x 3, as the joints have them. Raises MalformedFile."""
        joints = np.hstack([array.read() for array in self.joints])
        weights = np.hstack([array.floats() for array in self.weights])
        total = np.abs(weights).sum(axis=1)
        weights[total == 0, 0] = 1.0  # what follows no joint follows the first
        with np.errstate(over="ignore", invalid="ignore"):  # Mesh refuses what becomes infinite
            joints = np.where(weights == 0, 0, joints).astype(np.int64)
            weights /= np.where(total == 0, 1.0, total)[:, None]
        if joints.max(initial=0) >= len(self.matrices) or joints.min(initial=0) < 0:
            raise MalformedFile("bad-reference", "a vertex follows a joint that its skin lacks")
        moved = np.zeros_like(vertices)
        with np.errstate(over="ignore", invalid="ignore"):
            for start in range(0, len(vertices), _ROWS):
                rows = slice(start, start + _ROWS)
                for joint, weight in zip(joints[rows].T, weights[rows].T, strict=True):
                    matrix = self.matrices[joint]
                    point = np.einsum("vij,vj->vi", matrix[:, :3, :3], vertices[rows])
                    moved[rows] += weight[:, None] * (point + matrix[:, :3, 3])
        return moved

    @property
    def mirrored(self) -> bool:
        """Whether the joints turn a solid inside out."""
        return bool((np.linalg.det(self.matrices[:, :3, :3]) < 0).all())


@dataclass(frozen=True)
class Surface:
    """The primitives of a mesh that share their positions. morphs: weights and offsets."""

    positions: Array
    primitives: Sequence[Primitive]
    morphs: Sequence[tuple[float, Array]] = ()
    skin: Skin | None = None

    @property
    def vertex_count(self) -> int:
        """Rows that are read: of the positions and of each morph target."""
        return self.positions.count * (1 + len(self.morphs))

    @property
    def face_count(self) -> int:
        return sum(primitive.faces for primitive in self.primitives)

    def read(self) -> Triangles:
        vertices = self.positions.floats()
        with np.errstate(over="ignore", invalid="ignore"):
            for weight, offsets in self.morphs:
                vertices += weight * offsets.floats()
        faces = np.concatenate([primitive.read() for primitive in self.primitives])
        if self.skin is None:
            return vertices, faces
        return self.skin.moved(vertices), faces[:, ::-1] if self.skin.mirrored else faces


def surfaces(
    mesh: Document, buffers: Buffers, weights: Sequence[float], joints: Matrices | None
) -> list[Surface]:
    """The surfaces of a mesh; points and lines are passed over.

    weights: of its morph targets. joints: the matrices of the skin that it has, or None.
    """
    shared: dict[tuple, Surface] = {}
    primitives: dict[tuple, list[Primitive]] = {}
    for entry in items(mesh, "primitives"):
        mode = natural(entry, "mode", _TRIANGLES)
        attributes = children(entry, "attributes")
        if mode not in (_TRIANGLES, _STRIP, _FAN) or "POSITION" not in attributes:
            continue
        packed = extension(entry, DRACO)
        applied = [
            (float(weight), natural(target, "POSITION"))
            for weight, target in zip(weights, items(entry, "targets"), strict=False)
            if weight and "POSITION" in target
        ]
        following = _skin_attributes(attributes) if joints is not None else []
        # Of what moves the vertices all is the same where the key is.
        key = (
            natural(attributes, "POSITION"),
            None if packed is None else natural(packed, "bufferView"),
            tuple(applied),
            tuple(natural(attributes, name) for name in following),
        )
        if key not in shared:
            shared[key] = _surface(buffers, entry, applied, following, joints)
        vertices = shared[key].positions.count
        primitives.setdefault(key, []).append(_primitive(buffers, entry, mode, vertices))
    return [replace(surface, primitives=primitives[key]) for key, surface in shared.items()]


def _surface(
    buffers: Buffers,
    primitive: Document,
    applied: Sequence[tuple[float, int]],
    following: Sequence[str],
    joints: Matrices | None,
) -> Surface:
    """The positions of a primitive and what moves them, without its triangles."""

    def array(name: str, shape: str, types: str) -> Array:
        if name in children(extension(primitive, DRACO) or {}, "attributes"):
            return draco_attribute(buffers, primitive, name)
        return accessor(buffers, children(primitive, "attributes")[name], shape, types)

    positions = array("POSITION", "VEC3", _POSITIONS)
    _check_data(positions)
    morphs = [(weight, accessor(buffers, number, "VEC3", _POSITIONS)) for weight, number in applied]
    followed = [array(name, "VEC4", "u1u2u4f4") for name in following if name.startswith("J")]
    shares = [array(name, "VEC4", "u1u2f4") for name in following if name.startswith("W")]
    for found in (*(offsets for _, offsets in morphs), *followed, *shares):
        if found.count != positions.count:
            raise MalformedFile(
                "bad-accessor",
                f"morph targets, joints and weights must have {positions.count} rows each, "
                f"as the positions have, not {quoted(found.count)}",
            )
    skin = Skin(joints, followed, shares) if followed and joints is not None else None
    return Surface(positions, (), morphs, skin)


def _skin_attributes(attributes: Document) -> list[str]:
    """Names of the joints and weights of a primitive, of both as many."""
    found: list[str] = []
    for number in range(_SETS):
        names = [f"JOINTS_{number}", f"WEIGHTS_{number}"]
        if not attributes.keys() >= set(names):
            return found
        found += names
    if f"JOINTS_{_SETS}" in attributes:
        raise unsupported(f"vertices that follow more than {4 * _SETS} joints are not read")
    return found


def _primitive(buffers: Buffers, entry: Document, mode: int, vertices: int) -> Primitive:
    """The triangles of a primitive whose positions are of so many vertices."""
    corners: Array | None = None
    if extension(entry, DRACO) is not None:
        corners, mode = (
            draco_attribute(buffers, entry, None),
            _TRIANGLES,
        )  # also where it was strips
    elif "indices" in entry:
        corners = accessor(buffers, entry["indices"], "SCALAR", "u1u2u4")
        _check_data(corners)
    count = vertices if corners is None else corners.count
    if mode == _TRIANGLES and count % 3:
        raise MalformedFile(
            "bad-face", f"a list of triangles has {count} corners, no multiple of three"
        )
    return Primitive(mode, count, corners)


def _check_data(found: Array) -> None:
    if isinstance(found, Accessor) and found.values is None and found.replaced is None:
        raise unsupported("positions or indices have no data of their own, by an extension")
