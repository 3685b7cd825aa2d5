"""Mesh bytes to a `Mesh`: the triangles of a whole file, and nothing else that it holds.

A file passes three stations: its format is decided (`formats`), its bytes are read by the module
of that format into vertices and triangles, and `Mesh` checks these. Nothing outside the given
bytes is ever opened: a file that needs a second one is refused.

Formats that hold plain arrays (obj, off, ply, stl) are read with NumPy: to find out whether
trimesh would read such a file rightly, one has to read it first. Formats that hold scenes (glb,
gltf, 3mf) are checked, cut down to their triangles, and read by trimesh (`scene`).
"""

from model.loading.folders import find_meshes
from model.loading.formats import FORMATS, Format, detect_format
from model.loading.limits import Limits
from model.loading.load import load_mesh

__all__ = ["FORMATS", "Format", "Limits", "detect_format", "find_meshes", "load_mesh"]
