"""From a path or bytes to a Mesh."""

import os
from collections.abc import Callable
from pathlib import Path

from model.errors import MalformedFile, MeshError
from model.loading.formats import Format, detect_format
from model.loading.gltf import read_glb, read_gltf
from model.loading.limits import Limits
from model.loading.obj import read_obj
from model.loading.off import read_off
from model.loading.ply import read_ply
from model.loading.stl import read_stl
from model.loading.threemf import read_3mf
from model.loading.triangles import Triangles
from model.mesh import Mesh

_READERS: dict[str, Callable[[bytes], Triangles]] = {
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
    vertices, faces = _read(data, detect_format(data, name))
    limits = limits or Limits()
    limits.check("vertices", len(vertices))
    limits.check("faces", len(faces))
    return Mesh(vertices, faces)


def _read(data: bytes, known: Format) -> Triangles:
    """The triangles of a file whose format is decided."""
    try:
        return _READERS[known.extension](data)
    except MeshError:
        raise
    except Exception as error:
        # Damaged bytes can make the libraries underneath raise nearly anything.
        raise MalformedFile(
            "unreadable",
            f"the file cannot be read as {known.title} ({type(error).__name__}: {error}); "
            "it is damaged or was written wrongly, export it again",
        ) from error
