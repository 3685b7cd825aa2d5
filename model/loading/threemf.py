"""3MF: the meshes that the build places, from all model parts of the package."""

from collections import Counter
from dataclasses import dataclass

from meshconv3d.model.errors import MalformedFile
from meshconv3d.model.loading.archive import Archive, normal
from meshconv3d.model.loading.limits import Limits
from meshconv3d.model.loading.scene import Matrix, flatten, within
from meshconv3d.model.loading.text import quoted
from meshconv3d.model.loading.threemf_parts import Key, ModelPart, Object, Reference
from meshconv3d.model.loading.triangles import Triangles
from meshconv3d.model.loading.xml import Attributes, read_xml

_ROOT_KIND = "http://schemas.microsoft.com/3dmanufacturing/2013/01/3dmodel"
_RELATIONS = "_rels/.rels"
_USUAL_ROOT = "3d/3dmodel.model"


def read_3mf(data: bytes, limits: Limits) -> Triangles:
    """The triangles of a 3MF package. Raises MalformedFile and LimitExceeded."""
    objects, build = _collect(Archive(data, limits), limits)
    return flatten(_instances(objects, build, limits), limits)


def _collect(package: Archive, limits: Limits) -> tuple[dict[Key, Object], list[Reference]]:
    """All objects of the model parts that the root refers to, and the items of its build."""
    root = _root_part(package, limits)
    objects: dict[Key, Object] = {}
    build: list[Reference] = []
    waiting, seen, units = [root], {root}, set()
    counted: Counter[str] = Counter()
    while waiting:
        name = waiting.pop()
        if name not in package:
            raise MalformedFile("missing-data", f"the package has no part {quoted(name)}")
        part = ModelPart(name, counted, limits).read(package.read(name))
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


def _root_part(package: Archive, limits: Limits) -> str:
    """The part that the package names as its 3D model, or the one that usually is."""
    targets: list[str] = []

    def element(name: str, attributes: Attributes) -> None:
        external = attributes.get("TargetMode") == "External"
        if attributes.get("Type") == _ROOT_KIND and not external:
            targets.append(normal(attributes["Target"]))

    if _RELATIONS in package:
        read_xml(package.read(_RELATIONS), _RELATIONS, element, lambda *_: None, limits)
    if targets:
        return targets[0]
    if _USUAL_ROOT in package:
        return _USUAL_ROOT
    raise MalformedFile(
        "bad-header", "the zip archive is no 3MF package: it names no 3D model part"
    )


@dataclass
class _Leave:
    """Marks, among what waits, that all within an object is done."""

    key: Key


def _instances(
    objects: dict[Key, Object], build: list[Reference], limits: Limits
) -> list[tuple[Object, Matrix]]:
    """Every mesh that the build places, with its matrix; components are resolved."""
    placed: list[tuple[Object, Matrix]] = []
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
        if found.vertex_count or not found.components:
            placed.append((found, step.matrix))
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
