"""The JSON of a glTF file, and its entries, whose types are checked where they are used."""

import json
from typing import Any

import numpy as np
from numpy.typing import NDArray

from meshconv3d.model.errors import MalformedFile
from meshconv3d.model.loading.limits import Limits
from meshconv3d.model.loading.text import quoted

Document = dict[str, Any]

_ADVICE = "export as plain glTF 2.0 without it"
_SEMANTICS = {"JOINT": "JOINTS_0", "WEIGHT": "WEIGHTS_0"}  # names of glTF 1.0, and of 2.0


def parse(text: bytes, limits: Limits) -> Document:
    """The document. Raises MalformedFile and LimitExceeded."""
    # Every value follows one of these; the base64 of a buffer has none.
    limits.check("values", sum(text.count(mark) for mark in b",[{"))
    try:
        # Names may be in any encoding; they are not used.
        document = json.loads(text.decode("utf-8-sig", errors="replace").rstrip("\0"))
    except json.JSONDecodeError as error:
        raise MalformedFile(
            "bad-document", f"the file's JSON is damaged or cut off: {error}"
        ) from error
    except ValueError as error:
        raise MalformedFile("bad-number", "a number in the JSON has thousands of digits") from error
    except RecursionError as error:
        raise MalformedFile("bad-document", "the JSON is nested too deeply") from error
    if not isinstance(document, dict):
        raise MalformedFile("bad-document", "a glTF document must be a JSON object")
    return document


def upgraded(document: Document) -> Document:
    """A glTF 1.0 document in the form of 2.0: lists in place of objects whose entries have names.

    `bindShapeMatrix`, of which 2.0 knows nothing, stays in its skin. Techniques, materials and
    animations are left out. Raises MalformedFile.
    """
    numbers: dict[str, dict[str, int]] = {}
    lists: dict[str, list[Document]] = {}
    for kind in ("scenes", "nodes", "meshes", "skins", "accessors", "bufferViews", "buffers"):
        named = children(document, kind)
        # The binary part of a .glb has this name in 1.0, and in 2.0 is the first buffer.
        names = sorted(named, key=lambda name: name != "binary_glTF")
        numbers[kind] = {name: number for number, name in enumerate(names)}
        lists[kind] = [dict(_object(named[name], f"an entry of {kind}")) for name in names]

    def number(kind: str, name: Any) -> int:
        if not isinstance(name, str) or name not in numbers[kind]:
            raise MalformedFile("bad-reference", f"{quoted(name)} is not among the file's {kind}")
        return numbers[kind][name]

    for scene in lists["scenes"]:
        scene["nodes"] = [number("nodes", name) for name in entries(scene, "nodes")]
    joints = {str(node.get("jointName")): place for place, node in enumerate(lists["nodes"])}
    for skin in lists["skins"]:
        names = list(map(str, entries(skin, "jointNames")))
        skin["joints"] = [joints.get(name, -1) for name in names]  # -1: refused where it is used
        if "inverseBindMatrices" in skin:
            skin["inverseBindMatrices"] = number("accessors", skin["inverseBindMatrices"])
    for node in lists["nodes"].copy():
        # A node may have several meshes: each becomes a child.
        meshes = [{"mesh": number("meshes", name)} for name in entries(node, "meshes")]
        if "skin" in node:
            skin = number("skins", node.pop("skin"))
            meshes = [child | {"skin": skin} for child in meshes]
        inner = [number("nodes", name) for name in entries(node, "children")]
        first = len(lists["nodes"])
        node["children"] = [*inner, *range(first, first + len(meshes))]
        lists["nodes"] += meshes
    for mesh in lists["meshes"]:
        mesh["primitives"] = [dict(primitive) for primitive in items(mesh, "primitives")]
        for primitive in mesh["primitives"]:
            attributes = children(primitive, "attributes").items()
            primitive["attributes"] = {
                _SEMANTICS.get(key, key): number("accessors", name) for key, name in attributes
            }
            if "indices" in primitive:
                primitive["indices"] = number("accessors", primitive["indices"])
    for accessor in lists["accessors"]:
        # A stride belongs to the accessor, which therefore gets a view of its own.
        view = dict(lists["bufferViews"][number("bufferViews", accessor.get("bufferView"))])
        view["buffer"] = number("buffers", view.get("buffer"))
        if accessor.get("byteStride"):
            view["byteStride"] = accessor["byteStride"]
        accessor["bufferView"] = len(lists["bufferViews"])
        lists["bufferViews"].append(view)
    if "binary_glTF" in numbers["buffers"]:
        lists["buffers"][0].pop("uri", None)
    kept = {key: document[key] for key in ("extensionsUsed",) if key in document}
    if "scene" in document:
        kept["scene"] = number("scenes", document["scene"])
    return kept | lists


def entries(owner: Document, key: str) -> list[Any]:
    """The list under `key`, empty where there is none."""
    found = owner.get(key, [])
    if not isinstance(found, list):
        raise _wrong(key, "a list")
    return found


def children(owner: Document, key: str) -> Document:
    """The object under `key`, empty where there is none."""
    return _object(owner.get(key, {}), key)


def extension(owner: Document, name: str) -> Document | None:
    """What an extension says of an entry, or None."""
    found = children(owner, "extensions").get(name)
    return None if found is None else _object(found, name)


def item(document: Document, kind: str, number: Any) -> Document:
    """The entry `number` of a list of the document. Raises MalformedFile when there is none."""
    listed = entries(document, kind)
    return _object(listed[index(number, len(listed), kind)], f"an entry of {kind}")


def items(owner: Document, key: str) -> list[Document]:
    """All entries of a list of objects."""
    return [_object(entry, f"an entry of {key}") for entry in entries(owner, key)]


def index(number: Any, length: int, kind: str) -> int:
    """`number`, an index into `length` entries. Raises MalformedFile when it is none."""
    if _natural(number, f"an index into {kind}") >= length:
        raise MalformedFile(
            "bad-reference", f"entry {quoted(number)} of {kind} is used, but there are {length}"
        )
    return number


def natural(owner: Document, key: str, default: int | None = None) -> int:
    """The whole number from 0 under `key`. Raises MalformedFile when it is none."""
    return _natural(owner.get(key, default), key)


def reals(owner: Document, key: str, count: int | None = None) -> NDArray[np.float64]:
    """The finite numbers under `key`, `count` of them or any. Raises MalformedFile otherwise."""
    found = entries(owner, key)
    if len(found) == (len(found) if count is None else count) and all(
        type(value) in (int, float) for value in found
    ):
        # An integer may be larger than any float.
        values = np.array([value if abs(value) < 1e300 else np.inf for value in found], float)
        if np.isfinite(values).all():
            return values
    expected = "finite numbers" if count is None else f"{count} finite numbers"
    raise MalformedFile("bad-number", f"{key} must be {expected}")


def unsupported(what: str) -> MalformedFile:
    """The error for a feature that is not read."""
    return MalformedFile("unsupported-feature", f"{what}; {_ADVICE}")


def cut_off(needed: int, found: int) -> MalformedFile:
    """The error for data that ends too early."""
    return MalformedFile(
        "truncated",
        f"{quoted(needed)} bytes are declared where the file has {found}; "
        "it is cut off, export or upload it again",
    )


def _natural(value: Any, what: str) -> int:
    if not isinstance(value, int) or isinstance(value, bool) or value < 0:
        raise MalformedFile("bad-number", f"{what} must be a whole number from 0")
    return value


def _object(value: Any, what: str) -> Document:
    if not isinstance(value, dict):
        raise _wrong(what, "an object")
    return value


def _wrong(what: str, expected: str) -> MalformedFile:
    return MalformedFile("bad-document", f"{what} must be {expected} in glTF")
