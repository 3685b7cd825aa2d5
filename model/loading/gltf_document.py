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


def entries(owner: Document, key: str) -> list[Any]:
    """The list under `key`, empty where there is none."""
    found = owner.get(key, [])
    if not isinstance(found, list):
        raise _wrong(key, "a list")
    return found


def children(owner: Document, key: str) -> Document:
    """The object under `key`, empty where there is none."""
    return _object(owner.get(key, {}), key)


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


def reals(owner: Document, key: str, count: int) -> NDArray[np.float64]:
    """The `count` finite numbers under `key`. Raises MalformedFile when they are none."""
    found = entries(owner, key)
    if len(found) == count and all(type(value) in (int, float) for value in found):
        # An integer may be larger than any float.
        values = np.array([value if abs(value) < 1e300 else np.inf for value in found], float)
        if np.isfinite(values).all():
            return values
    raise MalformedFile("bad-number", f"a node's {key} must be {count} finite numbers")


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
