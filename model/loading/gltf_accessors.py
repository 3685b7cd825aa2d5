"""Checks of what a glTF document says of its bytes, before anything reads them."""

from typing import Any

from model.errors import MalformedFile

_SIZES = {5120: 1, 5121: 1, 5122: 2, 5123: 2, 5125: 4, 5126: 4}
_FLOAT = 5126
_POSITION_TYPES = frozenset({5120, 5121, 5122, 5123, _FLOAT})  # integers: KHR_mesh_quantization
_INDEX_TYPES = frozenset({5121, 5123, 5125})
_ADVICE = "export as plain glTF 2.0 without it"


def item(document: dict[str, Any], kind: str, number: Any) -> dict[str, Any]:
    """The entry `number` of a list of the document. Raises MalformedFile when there is none."""
    entries = document.get(kind, [])
    return entries[index(number, len(entries), kind)]


def index(number: Any, length: int, kind: str) -> int:
    """`number`, an index into `length` entries. Raises MalformedFile when it is none."""
    if natural(number, f"an index into {kind}") >= length:
        raise MalformedFile(
            "bad-reference", f"entry {number} of {kind} is used, but there are {length}"
        )
    return number


def natural(value: Any, what: str) -> int:
    """`value`, a whole number from 0. Raises MalformedFile when it is none."""
    if not isinstance(value, int) or isinstance(value, bool) or value < 0:
        raise MalformedFile("bad-number", f"{what} must be a whole number from 0, not {value!r}")
    return value


def only(entry: dict[str, Any], keys: tuple[str, ...]) -> dict[str, Any]:
    """The entry with these keys alone, as far as it has them."""
    return {key: entry[key] for key in keys if key in entry}


def unsupported(what: str) -> MalformedFile:
    """The error for a feature that is not read."""
    return MalformedFile("unsupported-feature", f"{what}; {_ADVICE}")


def cut_off(needed: int, found: int) -> MalformedFile:
    """The error for data that ends too early."""
    return MalformedFile(
        "truncated",
        f"{needed} bytes are declared where the file has {found}; "
        "it is cut off, export or upload it again",
    )


def check_positions(document: dict[str, Any], number: Any) -> int:
    """The count of an accessor of vertex positions. Raises MalformedFile."""
    accessor = item(document, "accessors", number)
    _check_type(accessor, "VEC3", _POSITION_TYPES)
    if accessor.get("normalized") and accessor["componentType"] != _FLOAT:
        raise unsupported("positions stored as normalized integers are not read")
    return _check_extent(document, accessor, 3)


def check_indices(document: dict[str, Any], number: Any) -> int:
    """The count of an accessor of vertex indices. Raises MalformedFile."""
    accessor = item(document, "accessors", number)
    _check_type(accessor, "SCALAR", _INDEX_TYPES)
    return _check_extent(document, accessor, 1)


def _check_type(accessor: dict[str, Any], shape: str, components: frozenset[int]) -> None:
    if "sparse" in accessor:
        raise unsupported("sparse accessors are not read")
    if "bufferView" not in accessor:
        raise unsupported("positions or indices have no data of their own (Draco or the like)")
    if accessor["type"] != shape or accessor["componentType"] not in components:
        raise MalformedFile(
            "bad-accessor",
            f"an accessor must be {shape} of component type {sorted(components)}, "
            f"not {accessor['type']} of {accessor['componentType']}",
        )


def _check_extent(document: dict[str, Any], accessor: dict[str, Any], numbers: int) -> int:
    """The accessor's count, once it is known to lie in its view and that in its buffer."""
    view = item(document, "bufferViews", accessor["bufferView"])
    buffer = item(document, "buffers", view["buffer"])
    length = natural(view["byteLength"], "a view's byteLength")
    end = natural(view.get("byteOffset", 0), "a view's byteOffset") + length
    if end > natural(buffer["byteLength"], "a buffer's byteLength"):
        raise cut_off(end, buffer["byteLength"])
    size = numbers * _SIZES[accessor["componentType"]]
    stride = natural(view.get("byteStride", size), "a view's byteStride")
    if stride < size:
        raise MalformedFile("bad-accessor", f"a byteStride of {stride} is less than {size} bytes")
    count = natural(accessor["count"], "an accessor's count")
    start = natural(accessor.get("byteOffset", 0), "an accessor's byteOffset")
    if count and start + (count - 1) * stride + size > length:
        raise cut_off(start + (count - 1) * stride + size, length)
    return count
