"""The arrays of a glTF file: what it says of its bytes is checked before any are read."""

import base64
import binascii
import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from typing import Any
from urllib.parse import unquote, unquote_to_bytes

import numpy as np
from numpy.typing import NDArray

from meshconv3d.model.errors import MalformedFile
from meshconv3d.model.loading.gltf.document import (
    Document,
    children,
    cut_off,
    extension,
    item,
    natural,
    reals,
)
from meshconv3d.model.loading.gltf.draco import DracoMesh
from meshconv3d.model.loading.gltf.meshopt import decompress
from meshconv3d.model.loading.limits import Limits
from meshconv3d.model.loading.text import quoted

_DTYPES = {5120: "i1", 5121: "u1", 5122: "<i2", 5123: "<u2", 5125: "<u4", 5126: "<f4"}
_WIDTHS = {"SCALAR": 1, "VEC2": 2, "VEC3": 3, "VEC4": 4, "MAT4": 16}
_MESHOPT = ("KHR_meshopt_compression", "EXT_meshopt_compression")
DRACO = "KHR_draco_mesh_compression"
_BLOCK = 2**20  # characters


class Buffers:
    """The bytes of each buffer and view of a document, decoded when they are first asked for.

    binary: the content of buffer 0 where that has no URI.
    pieces: the contents of buffers that are other files, by `piece_name`.
    """

    def __init__(
        self,
        document: Document,
        binary: bytes | None,
        pieces: Mapping[str, bytes],
        limits: Limits,
    ) -> None:
        self.document = document
        self._binary = binary
        self._pieces = pieces
        self._limits = limits
        self._contents: dict[int, bytes] = {}
        self._views: dict[int, NDArray[np.uint8]] = {}
        self._meshes: dict[tuple[int, int], DracoMesh] = {}
        self._unpacked_bytes = self._packed_bytes = 0

    def view(self, number: Any) -> NDArray[np.uint8]:
        """The bytes of a buffer view. Raises MalformedFile and LimitExceeded."""
        view = item(self.document, "bufferViews", number)
        if number not in self._views:
            packed = next(filter(None, (extension(view, name) for name in _MESHOPT)), None)
            self._views[number] = self._range(view) if packed is None else self._unpacked(packed)
        return self._views[number]

    def draco(self, number: int, corners: int) -> DracoMesh:
        """The mesh of so many corners that a buffer view holds in Draco's format."""
        content = self.view(number)
        if (number, corners) not in self._meshes:
            self._meshes[number, corners] = DracoMesh(content.tobytes(), corners)
        return self._meshes[number, corners]

    def _range(self, owner: Document) -> NDArray[np.uint8]:
        """The bytes that a view, or its compressed form, has in its buffer."""
        content = self._content(owner.get("buffer"))
        begin = natural(owner, "byteOffset", 0)
        end = begin + natural(owner, "byteLength", max(len(content) - begin, 0))
        if end > len(content):
            raise cut_off(end, len(content))
        return np.frombuffer(content, np.uint8, end - begin, begin)

    def _unpacked(self, packed: Document) -> NDArray[np.uint8]:
        count, stride = natural(packed, "count"), natural(packed, "byteStride")
        self._unpacked_bytes += count * stride
        self._packed_bytes += natural(packed, "byteLength")
        ratio = self._unpacked_bytes // max(self._packed_bytes, 1)
        self._limits.check("unpacked_bytes", self._unpacked_bytes)
        self._limits.check("unpacked_bytes_per_byte", ratio)
        mode, filtered = packed.get("mode"), packed.get("filter", "NONE")
        return decompress(self._range(packed), count, stride, str(mode), str(filtered))

    def _content(self, number: Any) -> bytes:
        """At least as many bytes as the buffer declares."""
        buffer = item(self.document, "buffers", number)
        if number not in self._contents:
            content = self._binary if number == 0 else None
            if "uri" in buffer:
                content = self._named(buffer["uri"])
            if content is None:
                raise MalformedFile(
                    "missing-data", "a buffer has neither data in the file nor a URI"
                )
            declared = natural(buffer, "byteLength", 0)
            if len(content) < declared:
                raise cut_off(declared, len(content))
            self._contents[number] = content
        return self._contents[number]

    def _named(self, uri: object) -> bytes:
        if isinstance(uri, str) and uri.startswith("data:"):
            return _decoded(uri)
        name = piece_name(uri)
        if name not in self._pieces:
            raise MalformedFile(
                "external-reference",
                f"the geometry lies in another file, {quoted(name)}, which is not there: keep the "
                "two side by side, send them in one form or ZIP archive, or export as .glb, which "
                "holds everything in one file",
            )
        return self._pieces[name]


@dataclass(frozen=True)
class Accessor:
    """`count` rows of `width` numbers.

    values: those that lie in a view, as a table over it; None where all are zero.
    replaced: rows that are others (of a sparse accessor) and what they are.
    matrix: 4 x 4, what points are to be multiplied with (WEB3D_quantized_attributes).
    """

    dtype: np.dtype
    width: int
    count: int
    normalized: bool
    values: NDArray | None
    replaced: tuple[NDArray, NDArray] | None = None
    matrix: NDArray[np.float64] | None = None

    def read(self) -> NDArray:
        """count x width, of `dtype`."""
        values = np.zeros((self.count, self.width), self.dtype)
        if self.values is not None:
            values[:] = self.values
        if self.replaced is not None:
            rows, others = self.replaced
            if (rows >= self.count).any():
                raise MalformedFile("bad-accessor", "a sparse accessor names a row past its end")
            values[rows.astype(np.int64)] = others
        return values

    def floats(self) -> NDArray[np.float64]:
        """count x width: integers that are normalised span -1 to 1, or 0 to 1."""
        values = decoded(self.read(), self.normalized)
        if self.matrix is not None:
            return values @ self.matrix[:3, :3].T + self.matrix[:3, 3]
        return values


@dataclass(frozen=True)
class DracoAttribute:
    """An accessor whose numbers lie in a mesh in Draco's format. number: the attribute's there, or
    None for the vertex indices of its faces."""

    mesh: DracoMesh
    number: int | None
    count: int
    normalized: bool

    def read(self) -> NDArray:
        """count x width. Raises MalformedFile where there are not as many as declared."""
        mesh = self.mesh
        values = mesh.indices() if self.number is None else mesh.attribute(self.number)
        if len(values) != self.count:
            raise MalformedFile(
                "bad-draco",
                f"a mesh that is packed by Draco has {len(values)} rows where {self.count} are "
                "declared; export the file again",
            )
        return values

    def floats(self) -> NDArray[np.float64]:
        """As those of an Accessor."""
        return decoded(self.read(), self.normalized)


Array = Accessor | DracoAttribute


def accessor(buffers: Buffers, number: Any, shape: str, types: str) -> Accessor:
    """An accessor of the document. Raises MalformedFile and LimitExceeded.

    shape: as in the document, "VEC3".
    types: the kinds of component that are read, as in NumPy's codes without their order, "f4u2".
    """
    entry = item(buffers.document, "accessors", number)
    dtype = np.dtype(_DTYPES.get(natural(entry, "componentType"), "O"))
    if entry.get("type") != shape or dtype.str[1:] not in re.findall("..", types):
        raise MalformedFile(
            "bad-accessor",
            f"an accessor of {quoted(entry.get('type'))}, componentType "
            f"{quoted(entry['componentType'])}, is used where {shape} is expected",
        )
    count, width = natural(entry, "count"), _WIDTHS[shape]
    values = None
    if "bufferView" in entry:
        stride = item(buffers.document, "bufferViews", entry["bufferView"]).get("byteStride")
        values = _table(buffers, entry, dtype, width, count, stride)
    found = Accessor(dtype, width, count, bool(entry.get("normalized")), values)
    if quantized := extension(entry, "WEB3D_quantized_attributes"):
        found = replace(found, matrix=reals(quantized, "decodeMatrix", 16).reshape(4, 4).T)
    if "sparse" in entry:
        found = replace(found, replaced=_replaced(buffers, children(entry, "sparse"), found))
    return found


def draco_attribute(buffers: Buffers, primitive: Document, name: str | None) -> DracoAttribute:
    """An attribute, or with no name the indices, of a primitive that is packed by Draco."""
    packed = children(children(primitive, "extensions"), DRACO)
    corners = item(buffers.document, "accessors", primitive.get("indices"))
    mesh = buffers.draco(natural(packed, "bufferView"), natural(corners, "count"))
    if name is None:
        return DracoAttribute(mesh, None, natural(corners, "count"), False)
    number = natural(children(packed, "attributes"), name)
    entry = item(buffers.document, "accessors", children(primitive, "attributes")[name])
    return DracoAttribute(mesh, number, natural(entry, "count"), bool(entry.get("normalized")))


def decoded(values: NDArray, normalized: bool) -> NDArray[np.float64]:
    """Numbers of any type as float64, normalised ones between -1 or 0 and 1."""
    with np.errstate(invalid="ignore"):  # some bits of a float32 are a NaN that warns
        numbers = values.astype(np.float64)
    if normalized and values.dtype.kind in "iu":
        return np.maximum(numbers / np.iinfo(values.dtype).max, -1)
    return numbers


def piece_name(uri: object) -> str:
    """The relative path that a URI names, without `.`. Raises MalformedFile where it may lead
    elsewhere: to an address, from the root, or out of the folder."""
    path = unquote(uri).replace("\\", "/") if isinstance(uri, str) else ""
    parts = [part for part in path.split("/") if part not in ("", ".")]
    if not parts or path.startswith("/") or ":" in path or ".." in parts or "\0" in path:
        raise MalformedFile(
            "external-reference",
            f"the geometry lies at {quoted(uri)}, which is never opened: only files in the same "
            "folder or below are; export as .glb, which holds everything in one file",
        )
    return "/".join(parts)


def _table(
    buffers: Buffers, entry: Document, dtype: np.dtype, width: int, count: int, stride: Any
) -> NDArray:
    """count x width numbers in the view that an accessor, or a part of a sparse one, names."""
    content = buffers.view(entry["bufferView"])
    start = natural(entry, "byteOffset", 0)
    size = width * dtype.itemsize
    stride = natural({"byteStride": stride}, "byteStride") if stride is not None else size
    if count > 1 and stride < size:
        raise MalformedFile("bad-accessor", f"a byteStride of {stride} is less than {size} bytes")
    end = start + (count - 1) * stride + size if count else start
    if end > len(content):
        raise cut_off(end, len(content))
    strides = (stride if count > 1 else size, dtype.itemsize)
    return np.ndarray((count, width), dtype, content, start, strides)


def _replaced(buffers: Buffers, sparse: Document, whole: Accessor) -> tuple[NDArray, NDArray]:
    """Rows of a sparse accessor, and the numbers in them."""
    count = natural(sparse, "count")
    if count > whole.count:
        raise MalformedFile(
            "bad-accessor", f"a sparse accessor of {whole.count} rows replaces {quoted(count)}"
        )
    at, other = children(sparse, "indices"), children(sparse, "values")
    dtype = np.dtype(_DTYPES.get(natural(at, "componentType"), "O"))
    if dtype.kind != "u" or "bufferView" not in at or "bufferView" not in other:
        raise MalformedFile("bad-accessor", "a sparse accessor has no rows or no values")
    rows = _table(buffers, at, dtype, 1, count, None)[:, 0]
    return rows, _table(buffers, other, whole.dtype, whole.width, count, None)


def _decoded(uri: str) -> bytes:
    """The bytes of a data: URI."""
    head, _, payload = uri.partition(",")
    raw = b"".join(_unquoted(payload))
    if not head.endswith(";base64"):
        return raw
    try:
        return base64.b64decode(raw)
    except binascii.Error as error:
        raise MalformedFile(
            "bad-data-uri", "a buffer's data: URI is no base64; export the file again"
        ) from error


def _unquoted(payload: str) -> Iterator[bytes]:
    """The payload piece by piece: each %xx takes many times its bytes."""
    start = 0
    while start < len(payload):
        end = start + _BLOCK
        escape = payload.find("%", end - 2, end)
        end = end if escape < 0 else escape  # never within one
        yield unquote_to_bytes(payload[start:end])
        start = end
