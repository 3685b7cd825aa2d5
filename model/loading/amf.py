"""AMF: the volumes of all objects, where constellations place them; as XML, or that in a ZIP."""

import re
from collections import Counter

import numpy as np

from meshconv3d.model.errors import MalformedFile
from meshconv3d.model.loading.archive import Archive, is_zip
from meshconv3d.model.loading.limits import Limits
from meshconv3d.model.loading.scene import flatten
from meshconv3d.model.loading.text import quoted
from meshconv3d.model.loading.threemf import placed_objects
from meshconv3d.model.loading.threemf.model import Object, Reference, to_numbers
from meshconv3d.model.loading.threemf.xml import SEPARATOR, Attributes, Parser
from meshconv3d.model.loading.triangles import Triangles

# Elements that hold a number, in a vertex, a triangle or an instance.
_POINT, _TRIANGLE = ("x", "y", "z"), ("v1", "v2", "v3")
_PLACE = ("deltax", "deltay", "deltaz", "rx", "ry", "rz")
_VALUES = frozenset((*_POINT, *_TRIANGLE, *_PLACE))
# What Slic3r and PrusaSlicer say of volumes that are not part of the shape.
_SLICER = re.compile(r"slic3r\.(modifier=(?!0)|volume_type=(?!ModelPart)).*")


def read_amf(data: bytes, limits: Limits) -> Triangles:
    """The triangles of an AMF file. Raises MalformedFile and LimitExceeded."""
    blocks, name = iter([data]), "the file"
    if is_zip(data):
        archive = Archive(data, limits)
        [name] = archive.names
        blocks = archive.blocks(name)
    document = _Document(limits)
    Parser(name, document.start, limits, on_end=document.end).read(blocks)
    return flatten(placed_objects(document.objects, document.shown(), limits), limits)


class _Document:
    """Objects and constellations, gathered from elements as they come."""

    def __init__(self, limits: Limits) -> None:
        self.objects: dict[tuple[str, str], Object] = {}
        self._limits = limits
        self._counted: Counter[str] = Counter()
        self._object = Object()
        self._values: dict[str, str] = {}  # of the vertex, triangle or instance
        self._instance = ""  # the object that it places
        self._metadata = ""
        self._first = 0  # triangle of the volume
        self._is_left_out = False

    def start(self, name: str, attributes: Attributes) -> bool:
        """Take the start of an element. Returns whether it is counted by a limit of its own."""
        kind = name.rpartition(SEPARATOR)[2]
        if kind in _VALUES:
            return kind not in self._values
        if kind in ("vertex", "triangle"):
            self._values = {}
            self._count("vertices" if kind == "vertex" else "faces")
            return True
        if kind in ("object", "constellation"):
            self._count("geometries")
            self._object = self.objects[("", attributes["id"])] = Object()
        elif kind == "instance":
            self._count("geometries")
            self._values, self._instance = {}, attributes["objectid"]
        elif kind == "volume":
            self._first, self._is_left_out = self._object.triangles.count, False
        elif kind == "metadata":
            self._metadata = attributes.get("type", "")
        return kind == "coordinates"

    def end(self, name: str, text: str) -> None:
        """Take the end of an element, with the text in it."""
        kind = name.rpartition(SEPARATOR)[2]
        if kind in _VALUES:
            self._values[kind] = text.strip()
        elif kind == "vertex":
            self._object.vertices.add(*(self._values[axis] for axis in _POINT))
        elif kind == "triangle":
            self._object.triangles.add(*(self._values[corner] for corner in _TRIANGLE))
        elif kind == "instance":
            self._object.components.append(Reference(("", self._instance), self._matrix()))
        elif kind == "metadata":
            self._is_left_out |= bool(_SLICER.fullmatch(f"{self._metadata}={text.strip()}"))
        elif kind == "volume" and self._is_left_out:
            last = self._object.triangles.count - 1
            self._object.left_out.append((self._first, last))

    def shown(self) -> list[Reference]:
        """What no constellation places, which may be one itself."""
        placed = {used.key for found in self.objects.values() for used in found.components}
        free = [key for key in self.objects if key not in placed]
        if self.objects and not free:
            raise MalformedFile("bad-scene", "all constellations contain themselves")
        return [Reference(key, np.eye(4)) for key in free]

    def _matrix(self) -> np.ndarray:
        """Rotation about x, then y, then z, by degrees; then a shift."""
        words = [self._values.get(name) or "0" for name in _PLACE]
        values = to_numbers(words, np.float64)
        if not np.isfinite(values).all():
            raise MalformedFile("bad-number", f"an instance is placed by {quoted(words)}")
        matrix = np.eye(4)
        for axis, angle in enumerate(np.radians(values[3:])):
            i, j = (axis + 1) % 3, (axis + 2) % 3
            turn = np.eye(4)
            turn[i, i] = turn[j, j] = np.cos(angle)
            turn[j, i] = np.sin(angle)
            turn[i, j] = -turn[j, i]
            matrix = turn @ matrix
        matrix[:3, 3] = values[:3]
        return matrix

    def _count(self, what: str) -> None:
        self._counted[what] += 1
        self._limits.check(what, self._counted[what])
