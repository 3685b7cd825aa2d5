"""3MF: the meshes that the build places, from all model parts of the package."""

import posixpath
import re
from collections import Counter
from collections.abc import Iterator
from contextlib import suppress
from dataclasses import dataclass
from functools import partial
from urllib.parse import unquote

from meshconv3d.model.errors import MalformedFile
from meshconv3d.model.loading.archive import Archive
from meshconv3d.model.loading.limits import Limits
from meshconv3d.model.loading.scene import Placed, flatten, within
from meshconv3d.model.loading.text import quoted
from meshconv3d.model.loading.threemf.model import Key, ModelPart, Object, Reference
from meshconv3d.model.loading.threemf.xml import Attributes, Parser
from meshconv3d.model.loading.triangles import Triangles

_ROOT_KIND = "http://schemas.microsoft.com/3dmanufacturing/2013/01/3dmodel"
_RELATIONS = "_rels/.rels"
_USUAL_ROOT = "3d/3dmodel.model"
_NUMBER = re.compile("[0-9]{1,9}")
# What slicers say of volumes: PrusaSlicer and its relatives of runs of triangles, BambuStudio and
# OrcaSlicer of components.
_VOLUMES = (
    "metadata/slic3r_pe_model.config",
    "metadata/superslicer_model.config",
    "metadata/model_settings.config",
)


class Package:
    """The parts of a package by their names, which are compared without case."""

    def __init__(self, data: bytes, limits: Limits) -> None:
        self._archive = Archive(data, limits, lambda name: _part_name("/" + name))
        self._limits = limits

    def __contains__(self, name: str) -> bool:
        return name in self._archive

    def find(self, reference: str, source: str = "") -> str:
        """The name of the part to which a reference in the part `source` leads.

        It should be relative to the folder of that part, or begin with a slash, which some forget.
        """
        name = _part_name(posixpath.join("/", posixpath.dirname(source), reference))
        from_root = _part_name("/" + reference)
        return from_root if name not in self and from_root in self else name

    def read(self, name: str) -> Iterator[bytes]:
        """A part in small pieces. Raises MalformedFile and LimitExceeded."""
        if name not in self:
            raise MalformedFile("missing-data", f"the package has no part {quoted(name)}")
        return self._archive.blocks(name)


def _part_name(path: str) -> str:
    """Parts are named without case, some with escapes, and never lead out of the package."""
    return posixpath.normpath(unquote(path).replace("\\", "/")).lstrip("/").lower()


def read_3mf(data: bytes, limits: Limits) -> Triangles:
    """The triangles of a 3MF package. Raises MalformedFile and LimitExceeded."""
    package = Package(data, limits)
    root = _root_part(package, limits)
    objects, build = _collect(package, root, limits)
    for name in _VOLUMES:
        if name in package:
            # Older slicers wrote names into it that make it no XML.
            with suppress(MalformedFile):
                volumes = _Volumes(objects, root)
                Parser(name, volumes.element, limits).read(package.read(name))
    return flatten(placed_objects(objects, build, limits), limits)


def _collect(
    package: Package, root: str, limits: Limits
) -> tuple[dict[Key, Object], list[Reference]]:
    """All objects of the model parts that the root refers to, and the items of its build."""
    objects: dict[Key, Object] = {}
    build: list[Reference] = []
    waiting, seen, units = [root], {root}, set()
    counted: Counter[str] = Counter()
    while waiting:
        name = waiting.pop()
        find = partial(package.find, source=name)
        part = ModelPart(name, find, counted, limits).read(package.read(name))
        units.add(part.unit)
        objects |= part.objects
        if name == root:
            build = part.build
        used = [*build, *(used for group in part.objects.values() for used in group.components)]
        named = {reference.key[0] for reference in used} - seen
        waiting += named
        seen |= named
    if len(units) > 1:
        raise MalformedFile(
            "unsupported-feature", f"the parts of the package mix units ({quoted(sorted(units))})"
        )
    return objects, build


def _root_part(package: Package, limits: Limits) -> str:
    """The part that the package names as its 3D model, or the one that usually is."""
    targets: list[str] = []

    def element(_: str, attributes: Attributes) -> None:
        external = attributes.get("TargetMode") == "External"
        if attributes.get("Type") == _ROOT_KIND and not external:
            targets.append(package.find(attributes["Target"]))

    if _RELATIONS in package:
        Parser(_RELATIONS, element, limits).read(package.read(_RELATIONS))
    if targets:
        return targets[0]
    if _USUAL_ROOT in package:
        return _USUAL_ROOT
    raise MalformedFile(
        "bad-header", "the zip archive is no 3MF package: it names no 3D model part"
    )


class _Volumes:
    """Takes from objects what a slicer says is no part of the shape: modifiers of settings,
    negative volumes, and what asks for supports or forbids them."""

    def __init__(self, objects: dict[Key, Object], root: str) -> None:
        self._objects = objects
        self._root = root
        self._object = Object()
        self._run: tuple[int, ...] | None = None

    def element(self, name: str, attributes: Attributes) -> None:
        """Take an element of the slicer's file."""
        if name == "object":
            self._object = self._objects.get((self._root, attributes.get("id", "")), Object())
        elif name == "volume":
            run = attributes.get("firstid", ""), attributes.get("lastid", "")
            self._run = tuple(map(int, run)) if all(map(_NUMBER.fullmatch, run)) else None
        elif name == "metadata" and self._run and attributes.get("type") == "volume":
            key, value = attributes.get("key"), attributes.get("value")
            if (key == "volume_type" and value != "ModelPart") or (key, value) == ("modifier", "1"):
                self._object.left_out.append(self._run)
        elif name == "part" and attributes.get("subtype", "normal_part") != "normal_part":
            kept = [c for c in self._object.components if c.key[1] != attributes.get("id")]
            self._object.components = kept


@dataclass
class _Leave:
    """Marks, among what waits, that all within an object is done."""

    key: Key


def placed_objects(
    objects: dict[Key, Object], build: list[Reference], limits: Limits
) -> list[Placed]:
    """Every mesh that the build places, with its matrix; components are resolved."""
    placed: list[Placed] = []
    inside: set[Key] = set()
    waiting: list[Reference | _Leave] = list(reversed(build))
    references = len(build)
    while waiting:
        step = waiting.pop()
        if isinstance(step, _Leave):
            inside.remove(step.key)
            continue
        if step.key not in objects:
            raise MalformedFile("bad-reference", f"object {_named(step.key)} does not exist")
        if step.key in inside:
            raise MalformedFile("bad-scene", f"object {_named(step.key)} contains itself")
        found = objects[step.key]
        if found.is_support:
            continue
        if found.vertex_count or not found.components:
            placed.append((found, step.matrix[None]))
            continue
        references += len(found.components)
        limits.check("geometries", references)
        inside.add(step.key)
        waiting.append(_Leave(step.key))
        waiting += [
            Reference(inner.key, within(step.matrix, inner.matrix))
            for inner in reversed(found.components)
        ]
    return placed


def _named(key: Key) -> str:
    return f"{quoted(key[1])} of {quoted(key[0])}"
