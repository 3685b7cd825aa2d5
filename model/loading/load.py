"""From a path or bytes to a Mesh."""

import os
from collections.abc import Callable
from pathlib import Path

from meshconv3d.model.errors import MalformedFile, MeshError, UnusableMesh
from meshconv3d.model.loading.formats import Format, detect_format
from meshconv3d.model.loading.gltf import read_glb, read_gltf
from meshconv3d.model.loading.limits import Limits
from meshconv3d.model.loading.obj import read_obj
from meshconv3d.model.loading.off import read_off
from meshconv3d.model.loading.ply import read_ply
from meshconv3d.model.loading.stl import is_exact_binary, read_stl
from meshconv3d.model.loading.text import as_utf8
from meshconv3d.model.loading.threemf import read_3mf
from meshconv3d.model.loading.triangles import Triangles
from meshconv3d.model.mesh import Mesh

_READERS: dict[str, Callable[[bytes, Limits], Triangles]] = {
    "obj": read_obj,
    "off": read_off,
    "stl": read_stl,
    "ply": read_ply,
    "glb": read_glb,
    "gltf": read_gltf,
    "3mf": read_3mf,
}


def load_mesh(
    source: str | os.PathLike[str] | bytes, name: str | None = None, limits: Limits | None = None
) -> Mesh:
    """All triangles of a mesh file: scenes flattened, polygons split, nothing welded or cleaned.

    source: a path, or the bytes of a file.
    name: the declared file name or extension ("cup.STL", "stl"). A path declares its own; bytes
        without a name are judged by their content.
    limits: the most that the file may hold; with None, the defaults.

    Raises UnknownFormat, MalformedFile, LimitExceeded or UnusableMesh, whatever the bytes are; and
    OSError (FileNotFoundError, ...) when a path cannot be read.
    """
    if isinstance(source, (bytes, bytearray, memoryview)):
        data = bytes(source)
    else:
        path = Path(source)
        data = path.read_bytes()
        name = path.suffix if name is None else name
    if not is_exact_binary(data):  # whose header may begin with any bytes
        data = as_utf8(data)
    return _read(data, detect_format(data, name), limits or Limits())


def _read(data: bytes, known: Format, limits: Limits) -> Mesh:
    """The mesh in a file whose format is decided."""
    try:
        return Mesh(*_READERS[known.extension](data, limits))
    except MeshError:
        raise
    except MemoryError as error:
        raise UnusableMesh(
            "out-of-memory",
            "reading the file takes more memory than there is; simplify the mesh or split it up",
        ) from error
    except Exception as error:
        # Damaged bytes can make the libraries underneath raise nearly anything.
        raise MalformedFile(
            "unreadable",
            f"the file cannot be read as {known.title}; "
            "it is damaged or was written wrongly, export it again",
        ) from error
