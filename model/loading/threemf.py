"""3MF: the meshes that the build places, from all model parts of the package.

trimesh reads one part well, but mixes up the objects of several (the production extension), and
loses instances where components nest deeply. So the package is rewritten as one part, in which
each item of the build is a mesh, and that is given to trimesh.
"""

import re
import zipfile
from collections.abc import Iterator
from io import BytesIO
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from model.errors import MalformedFile
from model.loading.scene import flatten, open_scene
from model.loading.triangles import Triangles

if TYPE_CHECKING:
    from trimesh import Scene

_CORE = "http://schemas.microsoft.com/3dmanufacturing/core/2015/02"
_PATH = "{http://schemas.microsoft.com/3dmanufacturing/production/2015/06}path"
_ROOT_KIND = "http://schemas.microsoft.com/3dmanufacturing/2013/01/3dmodel"
_USUAL_ROOT = "3d/3dmodel.model"
# Namespaces of extensions that leave the triangles as they are, or that are read.
_HARMLESS = re.compile("/(core|production|material|slice|beamlattice|trianglesets)/")

Key = tuple[str, str]  # the part that an object is in, and its id there


def read_3mf(data: bytes) -> Triangles:
    """The triangles of a 3MF package. Raises MalformedFile."""
    with _open_package(data) as package:
        objects, build = _collect(package)
    placed = list(_instances(objects, build))
    meshes = {key: objects[key].find("{*}mesh") for key, _ in placed}
    counts = [_count(mesh) for mesh in meshes.values()]
    scene = open_scene(_rewrite(meshes, placed), "3mf")
    _check_counts(scene, counts)
    return flatten(scene)


def _open_package(data: bytes) -> zipfile.ZipFile:
    try:
        return zipfile.ZipFile(BytesIO(data))
    except zipfile.BadZipFile as error:
        raise MalformedFile(
            "truncated",
            f"the package is not a whole zip archive ({error}); export or upload it again",
        ) from error


def _collect(package: zipfile.ZipFile) -> tuple[dict[Key, Any], list[tuple[Key, NDArray]]]:
    """All objects of the model parts that the root refers to, and the items of its build."""
    names = {_normal(name): name for name in package.namelist()}
    root = _root_part(package, names)
    objects: dict[Key, Any] = {}
    build: list[tuple[Key, NDArray]] = []
    waiting, seen, units = [root], {root}, set()
    while waiting:
        part = waiting.pop()
        if part not in names:
            raise MalformedFile("missing-data", f"the package has no part {part!r}")
        model = _parse(package.read(names[part]))
        _check_extensions(model)
        units.add(model.get("unit", "millimeter"))
        for element in model.iter("{*}object"):
            objects[part, element.attrib["id"]] = element
        if part == root:
            build = [_reference(entry, part) for entry in model.iterfind("{*}build/{*}item")]
        named = [key for key, _ in build] + [
            _reference(entry, part)[0] for entry in model.iter("{*}component")
        ]
        waiting += {target for target, _ in named} - seen
        seen.update(waiting)
    if len(units) > 1:
        raise MalformedFile(
            "unsupported-feature", f"the parts of the package mix units ({', '.join(units)})"
        )
    return objects, build


def _check_extensions(model: Any) -> None:
    for prefix in model.get("requiredextensions", "").split():
        namespace = model.nsmap.get(prefix, prefix)
        if not _HARMLESS.search(namespace):
            raise MalformedFile(
                "unsupported-feature",
                f"the file requires the extension {namespace}, which is not read; "
                "export as core 3MF without it",
            )


def _root_part(package: zipfile.ZipFile, names: dict[str, str]) -> str:
    if "_rels/.rels" in names:
        for relation in _parse(package.read(names["_rels/.rels"])).iter("{*}Relationship"):
            if relation.get("Type") == _ROOT_KIND and relation.get("TargetMode") != "External":
                return _normal(relation.attrib["Target"])
    if _USUAL_ROOT in names:
        return _USUAL_ROOT
    raise MalformedFile(
        "bad-header", "the zip archive is no 3MF package: it names no 3D model part"
    )


def _normal(path: str) -> str:
    """Part names are compared without case, and from the root of the package."""
    return path.replace("\\", "/").lstrip("/").lower()


def _parse(data: bytes) -> Any:
    from lxml import etree  # pyright: ignore[reportAttributeAccessIssue]: it has no stubs

    parser = etree.XMLParser(resolve_entities=False, no_network=True, load_dtd=False)
    # Looked for in the bytes first, before entities are expanded; then in the tree, since other
    # encodings spell it otherwise.
    root = None if b"<!DOCTYPE" in data else etree.fromstring(data, parser)
    if root is None or root.getroottree().docinfo.doctype:
        raise MalformedFile("bad-header", "a part of the package has a DTD, which 3MF forbids")
    return root


def _reference(entry: Any, part: str) -> tuple[Key, NDArray]:
    """The object that an item or component names, and its transform (4 x 4, of row vectors)."""
    path = entry.get(_PATH)
    key = (part if path is None else _normal(path), entry.attrib["objectid"])
    transform = np.eye(4)
    if "transform" in entry.attrib:
        transform[:, :3] = np.array(entry.attrib["transform"].split(), float).reshape(4, 3)
    return key, transform


def _instances(
    objects: dict[Key, Any], build: list[tuple[Key, NDArray]]
) -> Iterator[tuple[Key, NDArray]]:
    """Every mesh that the build places, with its transform; components are resolved."""
    waiting = [(key, transform, frozenset[Key]()) for key, transform in reversed(build)]
    while waiting:
        key, transform, ancestors = waiting.pop()
        if key not in objects:
            raise MalformedFile("bad-reference", f"object {key[1]} of {key[0]!r} does not exist")
        if key in ancestors:
            raise MalformedFile("bad-scene", f"object {key[1]} of {key[0]!r} contains itself")
        if objects[key].find("{*}mesh") is not None:
            yield key, transform
            continue
        components = objects[key].iterfind("{*}components/{*}component")
        inner = [_reference(component, key[0]) for component in components]
        waiting += [(child, own @ transform, ancestors | {key}) for child, own in reversed(inner)]


def _rewrite(meshes: dict[Key, Any], placed: list[tuple[Key, NDArray]]) -> bytes:
    """A package with these meshes in one part, numbered in order, and nothing else."""
    from lxml import etree  # pyright: ignore[reportAttributeAccessIssue]: it has no stubs

    numbers = {key: number for number, key in enumerate(meshes, start=1)}
    # Joined as text, since lxml takes quadratic time to move a large element to another document.
    # Without names, since trimesh merges objects by them.
    parts = [f'<model xmlns="{_CORE}"><resources>'.encode()]
    for key, mesh in meshes.items():
        content = etree.tostring(mesh, with_tail=False)
        parts.append(b'<object id="%d">%s</object>' % (numbers[key], content))
    parts.append(b"</resources><build>")
    for key, transform in placed:
        text = " ".join(map(repr, transform[:, :3].ravel().tolist()))
        parts.append(f'<item objectid="{numbers[key]}" transform="{text}"/>'.encode())
    parts.append(b"</build></model>")
    stream = BytesIO()
    with zipfile.ZipFile(stream, "w") as package:
        package.writestr("3D/3dmodel.model", b"".join(parts))
    return stream.getvalue()


def _count(mesh: Any) -> tuple[int, int]:
    """How many vertices and triangles a mesh element has."""
    return (
        int(mesh.xpath("count(*[local-name()='vertices']/*[local-name()='vertex'])")),
        int(mesh.xpath("count(*[local-name()='triangles']/*[local-name()='triangle'])")),
    )


def _check_counts(scene: "Scene", counts: list[tuple[int, int]]) -> None:
    """That all numbers were read: trimesh stops without a word at the first that is none."""
    for number, expected in enumerate(counts, start=1):
        geometry: Any = scene.geometry[str(number)]
        found = len(geometry.vertices), len(getattr(geometry, "faces", ()))
        if found != expected:
            raise MalformedFile(
                "bad-number",
                f"a mesh has {expected[0]} vertices and {expected[1]} triangles, but only "
                f"{found[0]} and {found[1]} are written in plain numbers; export it again",
            )
