"""One model part of a 3MF package: its objects and what it builds."""

import re
from collections import Counter
from collections.abc import Callable, Iterable
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from meshconv3d.model.errors import MalformedFile
from meshconv3d.model.loading.archive import normal
from meshconv3d.model.loading.limits import Limits
from meshconv3d.model.loading.scene import Matrix
from meshconv3d.model.loading.text import quoted
from meshconv3d.model.loading.triangles import Triangles
from meshconv3d.model.loading.xml import SEPARATOR, Attributes, read_xml

_PATH = f"http://schemas.microsoft.com/3dmanufacturing/production/2015/06{SEPARATOR}path"
# Namespaces of extensions that leave the triangles as they are, or that are read.
_HARMLESS = re.compile("/(core|production|material|slice|beamlattice|trianglesets)/")
_BATCH = 30_000  # words that are turned into numbers at once

Key = tuple[str, str]  # the part that an object is in, and its id there


@dataclass(frozen=True)
class Reference:
    """An object that an item or component places."""

    key: Key
    matrix: Matrix


class Numbers:
    """Attributes that come one by one, as one array."""

    def __init__(self, dtype: type) -> None:
        self._dtype = dtype
        self._waiting: list[str] = []
        self._arrays: list[NDArray] = []
        self.count = 0

    def add(self, a: str, b: str, c: str) -> None:
        self._waiting += (a, b, c)
        self.count += 1
        if len(self._waiting) >= _BATCH:
            self._convert()

    def rows(self) -> NDArray:
        """N x 3."""
        self._convert()
        return np.concatenate([np.empty(0, self._dtype), *self._arrays]).reshape(-1, 3)

    def _convert(self) -> None:
        self._arrays.append(to_numbers(self._waiting, self._dtype))
        self._waiting = []


@dataclass
class Object:
    """A mesh, or a group of components."""

    vertices: Numbers = field(default_factory=lambda: Numbers(np.float64))
    triangles: Numbers = field(default_factory=lambda: Numbers(np.int64))
    components: list[Reference] = field(default_factory=list)

    @property
    def vertex_count(self) -> int:
        return self.vertices.count

    @property
    def face_count(self) -> int:
        return self.triangles.count

    def read(self) -> Triangles:
        return self.vertices.rows(), self.triangles.rows()


class ModelPart:
    """What one part says, gathered from its elements as they come.

    counted: of all parts of the package so far, by the names of the limits.
    """

    def __init__(self, name: str, counted: Counter[str], limits: Limits) -> None:
        self.name = name
        self.unit = "millimeter"
        self.objects: dict[Key, Object] = {}
        self.build: list[Reference] = []
        self._counted = counted
        self._limits = limits
        self._namespaces: dict[str | None, str] = {}
        self._handlers: dict[str, Callable[[Attributes], None]] = {}
        self._object = Object()

    def read(self, blocks: Iterable[bytes]) -> "ModelPart":
        """Raises MalformedFile and LimitExceeded."""
        read_xml(blocks, self.name, self._element, self._namespaces.__setitem__, self._limits)
        return self

    def _element(self, name: str, attributes: Attributes) -> None:
        if not self._handlers:
            self._model(name, attributes)
        elif handler := self._handlers.get(name):
            handler(attributes)

    def _model(self, name: str, attributes: Attributes) -> None:
        """The root. Elements of other namespaces than its own are passed over."""
        namespace, separator, kind = name.rpartition(SEPARATOR)
        if kind != "model":
            raise MalformedFile("bad-header", f"{quoted(self.name)} is no 3D model")
        self.unit = attributes.get("unit", self.unit)
        for prefix in attributes.get("requiredextensions", "").split():
            self._check_extension(self._namespaces.get(prefix, prefix))
        handlers = {
            "object": self._start_object,
            "vertex": self._vertex,
            "triangle": self._triangle,
            "component": self._component,
            "item": self._item,
        }
        self._handlers = {namespace + separator + kind: call for kind, call in handlers.items()}

    def _check_extension(self, namespace: str) -> None:
        if not _HARMLESS.search(namespace):
            raise MalformedFile(
                "unsupported-feature",
                f"the file requires the extension {quoted(namespace)}, which is not read; "
                "export as core 3MF without it",
            )

    def _start_object(self, attributes: Attributes) -> None:
        self._count("geometries")
        self._object = Object()
        self.objects[self.name, attributes["id"]] = self._object

    def _vertex(self, attributes: Attributes) -> None:
        self._count("vertices")
        self._object.vertices.add(attributes["x"], attributes["y"], attributes["z"])

    def _triangle(self, attributes: Attributes) -> None:
        self._count("faces")
        self._object.triangles.add(attributes["v1"], attributes["v2"], attributes["v3"])

    def _component(self, attributes: Attributes) -> None:
        self._count("geometries")
        self._object.components.append(self._reference(attributes))

    def _item(self, attributes: Attributes) -> None:
        self._count("geometries")
        self.build.append(self._reference(attributes))

    def _reference(self, attributes: Attributes) -> Reference:
        """The object that an item or component names, and where it places it."""
        part = normal(attributes[_PATH]) if _PATH in attributes else self.name
        matrix = np.eye(4)
        if "transform" in attributes:
            words = attributes["transform"].split()
            if len(words) != 12:
                raise MalformedFile("bad-number", "a transform must be 12 numbers")
            matrix[:3] = to_numbers(words, np.float64).reshape(4, 3).T  # stored by columns
        return Reference((part, attributes["objectid"]), matrix)

    def _count(self, what: str) -> None:
        self._counted[what] += 1
        self._limits.check(what, self._counted[what])


def to_numbers(words: list[str], dtype: type) -> NDArray:
    """Each word as a number. Raises MalformedFile when one is none."""
    try:
        # Python reads 1_000 as a thousand.
        if "_" not in "".join(words):
            return np.array(words, dtype)
    except (ValueError, OverflowError):
        pass
    bad = next((word for word in words if not _is_number(word, dtype)), words[0])
    raise MalformedFile("bad-number", f"{quoted(bad)} stands where a number is expected")


def _is_number(word: str, dtype: type) -> bool:
    try:
        np.array([word], dtype)
    except (ValueError, OverflowError):
        return False
    return "_" not in word
