"""Mesh bytes to a `Mesh`: the triangles of a whole file, and nothing else that it holds.

A file passes three stations: its format is decided (`formats`), its bytes are read by the module
of that format into vertices and triangles, and `Mesh` checks these. Nothing outside the given
bytes is ever opened: other files that one needs are given with it (`find_pieces`, `MeshArchive`).

Every reader compares what the bytes declare with `Limits` before it makes arrays of that size, and
takes text and XML piece by piece, so that memory stays within a small multiple of the bytes and the
limits. Most formats are read with NumPy: to find out whether a general library would read a hostile
file rightly, and within bounds, one has to read it first. Libraries read what is too large to write
anew (`converters`), each file in a process of its own.
"""

from meshconv3d.model.loading.folders import (
    MeshArchive,
    extension,
    find_meshes,
    find_pieces,
    has_mesh_name,
    has_other_format,
    is_hidden,
    read_beside,
    walk_files,
    walk_meshes,
)
from meshconv3d.model.loading.formats import (
    FORMATS,
    TABLE,
    Format,
    FormatRow,
    detect_format,
    is_archive,
)
from meshconv3d.model.loading.limits import Limits
from meshconv3d.model.loading.load import load_mesh, warm_up

__all__ = [
    "FORMATS",
    "TABLE",
    "Format",
    "FormatRow",
    "Limits",
    "MeshArchive",
    "detect_format",
    "extension",
    "find_meshes",
    "find_pieces",
    "has_mesh_name",
    "has_other_format",
    "is_archive",
    "is_hidden",
    "load_mesh",
    "read_beside",
    "walk_files",
    "walk_meshes",
    "warm_up",
]
