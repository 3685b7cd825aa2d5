"""From a path or bytes to a Mesh."""

import errno
import os
from collections import Counter
from collections.abc import Mapping
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from meshconv3d.model.errors import MalformedFile, MeshError, UnusableMesh
from meshconv3d.model.loading.folders import MeshArchive, find_pieces, read_beside
from meshconv3d.model.loading.formats import ARCHIVE, detect_format
from meshconv3d.model.loading.gltf.meshopt import decompress
from meshconv3d.model.loading.limits import Limits
from meshconv3d.model.loading.stl import is_exact_binary
from meshconv3d.model.loading.text import as_utf8, quoted
from meshconv3d.model.loading.threemf.model import ModelPart
from meshconv3d.model.mesh import Mesh

_SHOWN = 5  # names of an archive's meshes in a message

# Files that between them need every kernel that reads text and polygons.
_CORNERS = b"0 0 0\n4 0 0\n1 1 0\n0 4 0\n"
_PLY = (
    b"ply\nformat %s 1.0\nelement vertex 4\nproperty char x\nproperty char y\nproperty char z\n"
    b"element face 2\nproperty list uchar uchar vertex_indices\nend_header\n"
)
_TEXTS = (
    b"v 0 0 0\nv 4 0 0\nv 1 1 0\nv 0 4 0\nf 1 2 3 4\n",
    _PLY % b"ascii" + _CORNERS + b"4 0 1 2 3\n3 0 1 3\n",
    _PLY % b"binary_little_endian"
    + bytes([0, 0, 0, 4, 0, 0, 1, 1, 0, 0, 4, 0, 4, 0, 1, 2, 3, 3, 0, 1, 3]),
    b"solid\nfacet normal 0 0 1 outer loop vertex 0 0 0 vertex 1 0 0 vertex 0 1 0 "
    b"endloop endfacet endsolid\n",
)


def load_mesh(
    source: str | os.PathLike[str] | bytes | bytearray | memoryview,
    name: str | None = None,
    limits: Limits | None = None,
    pieces: Mapping[str, bytes] | None = None,
) -> Mesh:
    """All triangles of a mesh file: scenes flattened, polygons split, nothing welded or cleaned.

    A ZIP archive that holds one mesh file is that file.

    source: a path, or the bytes of a file.
    name: the declared file name or extension ("cup.STL", "stl"). A path declares its own; bytes
        without a name are judged by their content.
    limits: the most that the file may hold; with None, the defaults.
    pieces: the other files in which a .gltf keeps its buffers, by their paths relative to it. With
        None, those of a path are looked for in its folder and below; bytes have none.

    Raises UnknownFormat, MalformedFile, LimitExceeded or UnusableMesh, whatever the bytes are; and
    OSError (FileNotFoundError, ...) when a path cannot be read.
    """
    limits = limits or Limits()
    if isinstance(source, (bytes, bytearray, memoryview)):
        data = bytes(source)
    else:
        path = Path(source)
        try:
            data = path.read_bytes()
        except ValueError as error:
            raise OSError(errno.EINVAL, "this is no path") from error
        name = path.suffix if name is None else name
        if pieces is None:
            pieces = find_pieces(data, partial(read_beside, path, limits), limits)
    data = _decoded(data)
    known = detect_format(data, name)
    try:
        if known is ARCHIVE:
            data, name, pieces = _only_mesh(data, limits)
            data = _decoded(data)
            known = detect_format(data, name)
        more = (pieces or {},) if known.in_pieces else ()
        triangles: tuple[Any, ...] = known.read(data, limits, *more)
        return Mesh(*triangles)
    except MeshError:
        raise
    except MemoryError as error:
        raise UnusableMesh(
            "too-much-memory",
            "reading the file takes more memory than there is; simplify the mesh or split it up",
        ) from error
    except Exception as error:
        # Damaged bytes can make the libraries underneath raise nearly anything.
        raise MalformedFile(
            "unreadable",
            f"the file cannot be read as {known.title}; "
            "it is damaged or was written wrongly, export it again",
        ) from error


def warm_up() -> None:
    """Compile the kernels of readers, or load them from where they are kept, and import Draco.

    Compiling takes more memory than reading, so a process does it before its memory is limited.
    """
    import DracoPy  # noqa: F401

    for mode, empty in (
        ("ATTRIBUTES", b"\xa0" + bytes(32)),
        ("TRIANGLES", b"\xe1" + bytes(16)),
        ("INDICES", b"\xd1" + bytes(4)),
    ):
        decompress(np.frombuffer(empty, np.uint8), 0, 4, mode, "NONE")
    for text in _TEXTS:
        load_mesh(text)
    ModelPart("", str, Counter(), Limits()).read([b"<model><vertices></vertices></model>"])


def _decoded(data: bytes) -> bytes:
    """Text in UTF-8, where it was in UTF-16."""
    # The header of a binary STL may begin with any bytes.
    return data if is_exact_binary(data) else as_utf8(data)


def _only_mesh(data: bytes, limits: Limits) -> tuple[bytes, str, Mapping[str, bytes]]:
    """Content, name and pieces of the one mesh file in an archive."""
    archive = MeshArchive(data, limits)
    if len(archive.names) == 1:
        [name] = archive.names
        content = archive.read(name)
        return content, name, archive.pieces(name, content)
    archive.check_any()
    shown = ", ".join(map(quoted, archive.names[:_SHOWN]))
    more = ", …" if len(archive.names) > _SHOWN else ""
    raise MalformedFile(
        "several-meshes",
        f"the ZIP archive holds {len(archive.names)} meshes ({shown}{more}): send it as a batch, "
        "in which each is a file of its own, or unpack it",
    )
