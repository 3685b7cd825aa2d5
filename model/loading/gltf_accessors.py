"""The arrays of a glTF file: what it says of its bytes is checked before any are read."""

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from meshconv3d.model.errors import MalformedFile
from meshconv3d.model.loading.gltf_buffers import Buffers
from meshconv3d.model.loading.gltf_document import Document, cut_off, item, natural, unsupported

_DTYPES = {5120: "i1", 5121: "u1", 5122: "<i2", 5123: "<u2", 5125: "<u4", 5126: "<f4"}
_FLOAT = 5126
_POSITION_TYPES = frozenset({5120, 5121, 5122, 5123, _FLOAT})  # integers: KHR_mesh_quantization
_INDEX_TYPES = frozenset({5121, 5123, 5125})


@dataclass(frozen=True)
class Accessor:
    """`count` rows of `width` numbers that are known to lie in their buffer.

    start: the byte of the buffer at which they begin.
    stride: bytes from row to row.
    """

    buffer: int
    dtype: np.dtype
    width: int
    count: int
    start: int
    stride: int

    def read(self, buffers: Buffers) -> NDArray:
        """count x width, a view of the buffer."""
        if not self.count:
            return np.empty((0, self.width), self.dtype)
        return np.ndarray(
            (self.count, self.width),
            self.dtype,
            buffers[self.buffer],
            self.start,
            (self.stride, self.dtype.itemsize),
        )


def positions(document: Document, number: Any) -> Accessor:
    """The accessor of vertex positions. Raises MalformedFile."""
    entry = item(document, "accessors", number)
    found = _accessor(document, entry, "VEC3", 3, _POSITION_TYPES)
    if entry.get("normalized") and found.dtype.kind != "f":
        raise unsupported("positions stored as normalized integers are not read")
    return found


def indices(document: Document, number: Any) -> Accessor:
    """The accessor of vertex indices. Raises MalformedFile."""
    entry = item(document, "accessors", number)
    return _accessor(document, entry, "SCALAR", 1, _INDEX_TYPES)


def _accessor(
    document: Document, entry: Document, shape: str, width: int, types: frozenset[int]
) -> Accessor:
    if "sparse" in entry:
        raise unsupported("sparse accessors are not read")
    if "bufferView" not in entry:
        raise unsupported("positions or indices have no data of their own (Draco or the like)")
    component = natural(entry, "componentType")
    if entry.get("type") != shape or component not in types:
        raise MalformedFile(
            "bad-accessor", f"an accessor must be {shape} of component type {sorted(types)}"
        )
    dtype = np.dtype(_DTYPES[component])
    view = item(document, "bufferViews", entry["bufferView"])
    buffer = item(document, "buffers", view.get("buffer"))
    length = natural(view, "byteLength")
    begin = natural(view, "byteOffset", 0)
    if begin + length > natural(buffer, "byteLength"):
        raise cut_off(begin + length, buffer["byteLength"])
    size = width * dtype.itemsize
    count = natural(entry, "count")
    stride = natural(view, "byteStride", size) if count > 1 else size
    if stride < size:
        raise MalformedFile("bad-accessor", f"a byteStride of {stride} is less than {size} bytes")
    start = natural(entry, "byteOffset", 0)
    if count and start + (count - 1) * stride + size > length:
        raise cut_off(start + (count - 1) * stride + size, length)
    return Accessor(view["buffer"], dtype, width, count, begin + start, stride)
