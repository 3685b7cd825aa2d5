"""Meshes in Draco's format, decoded by Google's library once their headers are known to be true.

The library makes arrays of the size that a header declares before it looks at the data.
"""

import struct
from typing import Any

import numpy as np
from numpy.typing import NDArray

from meshconv3d.model.errors import MalformedFile

_HEADER = struct.Struct("<5sBBBBH")  # magic, version, kind, method, flags
_MESH, _EDGEBREAKER, _METADATA = 1, 1, 0x8000


class DracoMesh:
    """A mesh that is decoded when it is first read. corners: three for each of its faces."""

    def __init__(self, content: bytes, corners: int) -> None:
        self._content = content
        self._corners = corners
        self._mesh: Any = None

    def indices(self) -> NDArray[np.uint32]:
        """N x 1, of the corners of its faces. Raises MalformedFile."""
        return self._decoded().faces.reshape(-1, 1)

    def attribute(self, number: int) -> NDArray:
        """A row of the attribute with this unique number for each vertex. Raises MalformedFile."""
        found = self._decoded().get_attribute_by_unique_id(number)
        if found is None:
            raise _damaged()
        return found["data"]

    def _decoded(self) -> Any:
        if self._mesh is None:
            import DracoPy

            if _declared_corners(self._content) not in (None, self._corners):
                raise _damaged()
            try:
                self._mesh = DracoPy.decode(self._content)
            except (DracoPy.FileTypeException, ValueError) as error:
                raise _damaged() from error
            if not isinstance(self._mesh, DracoPy.DracoMesh):
                raise _damaged()
        return self._mesh


def _damaged() -> MalformedFile:
    return MalformedFile(
        "bad-draco",
        "a mesh that is packed by Draco is damaged or is not as large as declared; "
        "export the file again",
    )


def _declared_corners(content: bytes) -> int | None:
    """Corners of faces by the header of an edgebreaker mesh; None for other methods."""
    try:
        magic, major, minor, kind, method, flags = _HEADER.unpack_from(content)
        if magic != b"DRACO" or kind != _MESH:
            raise _damaged()
        if method != _EDGEBREAKER:
            return None
        old = major < 2
        position = _HEADER.size
        if flags & _METADATA:
            position = _after_metadata(content, position)
        position += 1  # the kind of traversal
        if (major, minor) < (2, 2):
            _, position = _count(content, position, old)
        _, position = _count(content, position, old)  # vertices
        faces, _ = _count(content, position, old)
    except (struct.error, IndexError) as error:
        raise _damaged() from error
    return 3 * faces


def _after_metadata(content: bytes, position: int) -> int:
    attributes, position = _count(content, position)
    for number in range(attributes + 1):  # the last is of the whole mesh
        if number < attributes:
            _, position = _count(content, position)  # of which attribute it is
        values, position = _count(content, position)
        for _ in range(values):
            position += 1 + content[position]  # the name
            position += 1 + content[position]  # the value
        nested, position = _count(content, position)
        if nested:
            raise _damaged()  # which no exporter of glTF writes
    return position


def _count(content: bytes, position: int, fixed: bool = False) -> tuple[int, int]:
    """The number at `position`, of four bytes or of seven bits a byte, and where it ends."""
    if fixed:
        return struct.unpack_from("<I", content, position)[0], position + 4
    value = shift = 0
    while True:
        byte = content[position]
        position += 1
        value |= (byte & 127) << shift
        shift += 7
        if byte < 128 or shift > 35:
            return value, position
