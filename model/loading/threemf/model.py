"""One model part of a 3MF package: its objects and what it builds."""

import re
from collections import Counter
from collections.abc import Callable, Iterable
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from meshconv3d.model.errors import MalformedFile
from meshconv3d.model.loading.limits import Limits
from meshconv3d.model.loading.scene import Matrix
from meshconv3d.model.loading.text import quoted
from meshconv3d.model.loading.threemf.xml import SEPARATOR, Attributes, Parser, scan_elements
from meshconv3d.model.loading.triangles import Triangles

_PATH = f"http://schemas.microsoft.com/3dmanufacturing/production/2015/06{SEPARATOR}path"
# Namespaces of extensions that leave the triangles as they are, or that are read.
_HARMLESS = re.compile("/(core|production|material|slice|beamlattice|trianglesets)/")
_SUPPORTS = ("support", "solidsupport")  # types of object that are not part of the shape
_BATCH = 30_000  # words that are turned into numbers at once

# A tag that begins a list, and what an element of one takes at least.
_LIST = re.compile(rb"<([\w.-]+:)?(?:vertices|triangles)\s*>")
_SHORTEST = len('<vertex x="0" y="0" z="0"/>')
# Of a part: blocks of text, lists, and elements in these of another form than the usual. After so
# many the parser, which takes a fraction of such a step for each, reads alone.
_MOST_STEPS = 50_000
_NO_QUOTES = bytes.maketrans(b"\"'", b"  ")

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

    def extend(self, rows: NDArray) -> None:
        """Add rows, N x 3."""
        if len(rows):
            self._convert()
            self._arrays.append(rows.astype(self._dtype).reshape(-1))
            self.count += len(rows)


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
        self._lists: dict[str, str] = {}
        self._list = ""  # the latest element, if it is one of _LISTS
        self._reading: _List | None = None
        self._tag = b""  # what the elements of that begin with
        self._steps = 0

    def read(self, blocks: Iterable[bytes]) -> "ModelPart":
        """Raises MalformedFile and LimitExceeded."""
        parser = Parser(self.name, self._element, self._limits, self._namespaces.__setitem__)
        text = b""
        for block in blocks:
            text = self._read_on(parser, text + block)
            parser.check_tag(len(text))
        parser.feed(text)
        parser.feed(b"", last=True)
        return self

    def _read_on(self, parser: Parser, text: bytes) -> bytes:
        """Read text up to a tag that has not ended, which is returned.

        The bulk of a model is lists of vertices or triangles. Once the parser has found that a tag
        begins one, a kernel reads the elements in there as long as they have the usual form, and
        the parser what is left.
        """
        codes = np.frombuffer(text + b"\n", np.uint8)
        plain = np.frombuffer(text.translate(_NO_QUOTES) + b"\n", np.uint8)
        place = 0
        while self._steps < _MOST_STEPS:
            self._steps += 1
            if self._reading is not None:
                place = self._read_list(self._reading, codes, plain, place)
                end = text.find(b">", place) + 1
                if not end:
                    return text[place:]
                if not text.startswith(self._tag, place):
                    self._reading = None  # the list ends, or nobody knows where this does
                parser.feed(text[place:end])
                place = end
                continue
            found = _LIST.search(text, place)
            if found is None:
                break
            began = parser.feed(text[place : found.end()])
            # Which is no list in a comment, or of another namespace.
            if self._list and parser.started == began + found.start() - place:
                self._reading = _LISTS[self._list]
                self._tag = b"<" + (found[1] or b"") + self._reading.element
            place = found.end()
        cut = text.rfind(b"<", place)
        end = cut if cut > text.rfind(b">", place) else len(text)
        parser.feed(text[place:end])
        return text[end:]

    def _read_list(
        self, listed: "_List", codes: NDArray[np.uint8], plain: NDArray[np.uint8], place: int
    ) -> int:
        """Read the elements of a list from `place` on. Returns where the first other thing is.

        codes: of the text; plain: the same without quotes.
        """
        rows = np.empty(((len(codes) - place) // _SHORTEST + 1, 3))
        tag = np.frombuffer(self._tag, np.uint8)
        count, place = scan_elements(codes, plain, place, tag, listed.names, listed.whole, rows)
        self._count(listed.limit, count)
        listed.numbers(self._object).extend(rows[:count])
        return place

    def _element(self, name: str, attributes: Attributes) -> object:
        self._list = self._lists.get(name, "")
        if not self._handlers:
            return self._model(name, attributes)
        handler = self._handlers.get(name)
        return handler is not None and handler(attributes)

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
        self._lists = {namespace + separator + kind: kind for kind in _LISTS}

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

    def _count(self, what: str, count: int = 1) -> None:
        self._counted[what] += count
        self._limits.check(what, self._counted[what])


@dataclass(frozen=True)
class _List:
    """A list in a mesh. element: the name of its elements, names: of their attributes, padded to
    two characters; whole: whether these are whole numbers; limit: what counts the elements;
    numbers: where they belong."""

    element: bytes
    names: NDArray[np.uint8]
    whole: bool
    limit: str
    numbers: Callable[[Object], Numbers]


def _names(*names: bytes) -> NDArray[np.uint8]:
    return np.frombuffer(b"".join(name.ljust(2, b"=") for name in names), np.uint8).reshape(3, 2)


_LISTS = {
    "vertices": _List(b"vertex", _names(b"x", b"y", b"z"), False, "vertices", lambda o: o.vertices),
    "triangles": _List(
        b"triangle", _names(b"v1", b"v2", b"v3"), True, "faces", lambda o: o.triangles
    ),
}


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
