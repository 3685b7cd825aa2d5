"""The XML of a 3MF package: read as it comes, without a tree, a document type or entities."""

import re
from collections import Counter
from collections.abc import Callable, Iterable
from dataclasses import dataclass, field
from xml.parsers import expat

import numpy as np
from numpy.typing import NDArray

from meshconv3d.model.errors import MalformedFile
from meshconv3d.model.loading.limits import Limits
from meshconv3d.model.loading.scene import Matrix
from meshconv3d.model.loading.text import quoted
from meshconv3d.model.loading.triangles import Triangles

Attributes = dict[str, str]

_SEPARATOR = "}"  # between the namespace and the name of an element or attribute
_ENCODINGS = frozenset({"utf-8", "utf-16", "us-ascii", "iso-8859-1"})
_DEEPEST = 1000
_DISTINCT_NAMES = 10_000
_NAMESPACE_LENGTH = 250  # characters, which each name in the namespace repeats
_ORDINARY_ATTRIBUTES = 8  # of a vertex or triangle
_OUT_OF_MEMORY = expat.errors.codes[expat.errors.XML_ERROR_NO_MEMORY]

_PATH = f"http://schemas.microsoft.com/3dmanufacturing/production/2015/06{_SEPARATOR}path"
# Namespaces of extensions that leave the triangles as they are, or that are read.
_HARMLESS = re.compile("/(core|production|material|slice|beamlattice|trianglesets)/")
_SUPPORTS = ("support", "solidsupport")  # types of object that are not part of the shape
_BATCH = 30_000  # words that are turned into numbers at once

Key = tuple[str, str]  # the part that an object is in, and its id there


def read_xml(
    blocks: Iterable[bytes],
    name: str,
    on_element: Callable[[str, Attributes], object],
    limits: Limits,
    on_namespace: Callable[[str | None, str], object] = lambda *_: None,
) -> None:
    """Calls `on_element` for the start of every element, in the order of the text.

    name: of the text, for messages.
    on_element: returns True for a vertex or a triangle, which other limits count; what is left
        counts as `values`.
    on_namespace: called for each prefix that is bound to a namespace, before its element.

    Raises MalformedFile and LimitExceeded.
    """
    depth = values = 0

    def start(element: str, attributes: Attributes) -> None:
        nonlocal depth, values
        depth += 1
        if depth > _DEEPEST:  # expat remembers every element that is open
            raise _malformed(name, f"elements are nested more than {_DEEPEST} deep")
        count = len(attributes)
        if not on_element(element, attributes) or count > _ORDINARY_ATTRIBUTES:
            values += 1 + count
            limits.check("values", values)

    def end(_: str) -> None:
        nonlocal depth
        depth -= 1

    def namespace(prefix: str | None, uri: str | None) -> None:
        nonlocal values
        values += 1
        limits.check("values", values)
        if uri is not None and len(uri) > _NAMESPACE_LENGTH:
            raise _malformed(name, f"a namespace has more than {_NAMESPACE_LENGTH} characters")
        on_namespace(prefix, uri or "")

    names: dict[str, str] = {}  # expat remembers every name that it has met
    parser = expat.ParserCreate(namespace_separator=_SEPARATOR, intern=names)
    parser.StartElementHandler = start
    parser.EndElementHandler = end
    parser.StartNamespaceDeclHandler = namespace
    parser.XmlDeclHandler = _check_declaration
    parser.StartDoctypeDeclHandler = _refuse_document_type
    given = 0
    try:
        for block in blocks:
            parser.Parse(block, False)
            tag = given - parser.CurrentByteIndex  # what no block has ended yet
            given += len(block)
            limits.check("tag_bytes", tag, f"the XML of {quoted(name)} has a tag of {tag} bytes")
            if len(names) > _DISTINCT_NAMES:
                raise _malformed(name, f"it has more than {_DISTINCT_NAMES} different names")
        parser.Parse(b"", True)
    except expat.ExpatError as error:
        if error.code == _OUT_OF_MEMORY:
            raise MemoryError from error
        raise _malformed(name, str(error)) from error
    except KeyError as error:
        raise _malformed(name, f"an element has no attribute {quoted(error.args[0])}") from error


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
    """A mesh, or a group of components.

    left_out: first and last of each run of triangles that are not part of the shape.
    """

    vertices: Numbers = field(default_factory=lambda: Numbers(np.float64))
    triangles: Numbers = field(default_factory=lambda: Numbers(np.int64))
    components: list[Reference] = field(default_factory=list)
    is_support: bool = False
    left_out: list[tuple[int, ...]] = field(default_factory=list)

    @property
    def vertex_count(self) -> int:
        return self.vertices.count

    @property
    def face_count(self) -> int:
        return self.triangles.count

    def read(self) -> Triangles:
        vertices, faces = self.vertices.rows(), self.triangles.rows()
        if not self.left_out or not len(faces):
            return vertices, faces
        first, last = np.clip(np.array(self.left_out).T, 0, len(faces) - 1)
        changes = np.zeros(len(faces) + 1, np.int64)
        np.add.at(changes, first, 1)
        np.add.at(changes, last + 1, -1)
        return vertices, faces[np.cumsum(changes)[:-1] <= 0]


class ModelPart:
    """What one model part says, gathered from its elements as they come.

    find: gives the name of the part to which a reference in this one leads.
    counted: of all parts of the package so far, by the names of the limits.
    """

    def __init__(
        self, name: str, find: Callable[[str], str], counted: Counter[str], limits: Limits
    ) -> None:
        self.name = name
        self.unit = "millimeter"
        self.objects: dict[Key, Object] = {}
        self.build: list[Reference] = []
        self._find = find
        self._counted = counted
        self._limits = limits
        self._namespaces: dict[str | None, str] = {}
        self._handlers: dict[str, Callable[[Attributes], object]] = {}
        self._object = Object()

    def read(self, blocks: Iterable[bytes]) -> "ModelPart":
        """Raises MalformedFile and LimitExceeded."""
        read_xml(blocks, self.name, self._element, self._limits, self._namespaces.__setitem__)
        return self

    def _element(self, name: str, attributes: Attributes) -> object:
        if not self._handlers:
            return self._model(name, attributes)
        handler = self._handlers.get(name)
        return handler is not None and handler(attributes)

    def _model(self, name: str, attributes: Attributes) -> None:
        """The root. Elements of other namespaces than its own are passed over."""
        namespace, separator, kind = name.rpartition(_SEPARATOR)
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
        self._object = Object(is_support=attributes.get("type") in _SUPPORTS)
        self.objects[self.name, attributes["id"]] = self._object

    def _vertex(self, attributes: Attributes) -> bool:
        self._count("vertices")
        self._object.vertices.add(attributes["x"], attributes["y"], attributes["z"])
        return True

    def _triangle(self, attributes: Attributes) -> bool:
        self._count("faces")
        self._object.triangles.add(attributes["v1"], attributes["v2"], attributes["v3"])
        return True

    def _component(self, attributes: Attributes) -> None:
        self._count("geometries")
        self._object.components.append(self._reference(attributes))

    def _item(self, attributes: Attributes) -> None:
        self._count("geometries")
        self.build.append(self._reference(attributes))

    def _reference(self, attributes: Attributes) -> Reference:
        """The object that an item or component names, and where it places it."""
        part = self._find(attributes[_PATH]) if _PATH in attributes else self.name
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


def _check_declaration(_version: str, encoding: str | None, _standalone: int) -> None:
    # Others would be looked up in Python's own files.
    if encoding is not None and encoding.lower() not in _ENCODINGS:
        raise MalformedFile(
            "unsupported-feature", f"XML in the encoding {quoted(encoding)} is not read, use UTF-8"
        )


def _refuse_document_type(*_: object) -> None:
    raise MalformedFile("bad-header", "a part of the package has a DTD, which 3MF forbids")


def _malformed(name: str, why: str) -> MalformedFile:
    return MalformedFile("bad-document", f"the XML of {quoted(name)} makes no sense: {why}")
