"""Formats that libraries of the extra `formats` read, each file in a process of its own.

These libraries crash on some damaged files and hang on others. A script of this folder calls each;
scripts and `main`, which runs them, import nothing of this project. They run in an empty folder,
with bounds on time and output, with the memory that this process may have. Scripts refuse files
that refer to others, before a library opens these.
"""

import os
import subprocess
import sys
import tempfile
from dataclasses import dataclass
from io import BytesIO
from pathlib import Path

import numpy as np
from numpy.lib.npyio import NpzFile
from numpy.typing import NDArray

from meshconv3d.model.errors import MalformedFile, UnusableMesh
from meshconv3d.model.loading.gltf import read_glb
from meshconv3d.model.loading.limits import Limits
from meshconv3d.model.loading.scene import Placed, flatten
from meshconv3d.model.loading.triangles import Triangles, triangulate

_MAIN = Path(__file__).with_name("main.py")
_NO_MEMORY, _NO_ROOM = 3, 4  # exit statuses of `main`
_KEPT = ("PATH", "LD_LIBRARY_PATH", "DYLD_LIBRARY_PATH")  # of the environment
_ONE_THREAD = {"OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1", "PXR_WORK_THREAD_LIMIT": "1"}


def convert(script: str, data: bytes, limits: Limits) -> Triangles:
    """The triangles of a file, by the script of this name.

    Raises MalformedFile, LimitExceeded and UnusableMesh.
    """
    output = _run(_MAIN.with_name(f"{script}.py"), data, limits)
    if output.startswith(b"glTF"):
        return read_glb(output, limits, {})
    if not output:
        raise MalformedFile(
            "unreadable",
            f"the library that reads {script.upper()} finds no shape in the file, or fails on it; "
            "export it again, or as STL or GLB",
        )
    with np.load(BytesIO(output), allow_pickle=False) as arrays:
        if "refusal" in arrays:
            raise MalformedFile("unsupported-feature", str(arrays["refusal"]))
        return flatten(_placed(arrays, limits), limits)


def _run(script: Path, data: bytes, limits: Limits) -> bytes:
    """What a script writes; nothing where it fails."""
    try:
        folder = tempfile.TemporaryDirectory(prefix="meshconv3d-")
    except OSError as error:
        raise _no_room() from error
    with folder as path:
        source, target = Path(path, "input"), Path(path, "output")
        try:
            source.write_bytes(data)
        except OSError as error:
            raise _no_room() from error
        kept = {name: os.environ[name] for name in _KEPT if name in os.environ}
        bounds = map(str, (limits.converter_seconds, limits.unpacked_bytes))
        try:
            done = subprocess.run(
                [sys.executable, "-I", _MAIN, script, source, target, *bounds],
                stdin=subprocess.DEVNULL,
                stdout=subprocess.DEVNULL,
                stderr=subprocess.DEVNULL,
                env={**kept, **_ONE_THREAD, "TMPDIR": path, "HOME": path},
                cwd=path,
                timeout=limits.converter_seconds,
                check=False,
            )
        except subprocess.TimeoutExpired as error:
            raise UnusableMesh(
                "too-slow",
                f"turning the file into triangles takes more than {limits.converter_seconds} "
                "seconds; simplify it, or export it as STL or GLB",
            ) from error
        if done.returncode == _NO_MEMORY:
            raise MemoryError
        if done.returncode == _NO_ROOM:
            raise _no_room()
        return target.read_bytes() if done.returncode == 0 and target.is_file() else b""


def _no_room() -> UnusableMesh:
    return UnusableMesh(
        "no-temporary-folder",
        "reading this format needs a folder for temporary files, and there is none that can be "
        "written, or it is full: set TMPDIR, or convert the mesh to STL or GLB",
    )


@dataclass(frozen=True)
class _Polygons:
    """Polygons of a mesh; arguments of `triangulate`."""

    vertices: NDArray[np.float64]
    corners: NDArray[np.int64]
    counts: NDArray[np.int64]
    limits: Limits

    @property
    def vertex_count(self) -> int:
        return len(self.vertices)

    @property
    def face_count(self) -> int:
        return int(np.maximum(self.counts - 2, 0).sum())

    def read(self) -> Triangles:
        return self.vertices, triangulate(self.vertices, self.corners, self.counts, self.limits)


def _placed(arrays: NpzFile, limits: Limits) -> list[Placed]:
    """The meshes of `main`'s output, where they are placed."""
    limits.check("instances", len(arrays["shown"]))
    ends = np.cumsum(arrays["sizes"], axis=0)[:-1].T
    columns = [
        np.split(arrays[name], cuts)
        for name, cuts in zip(("vertices", "corners", "counts"), ends, strict=True)
    ]
    shown, matrices = arrays["shown"], arrays["matrices"]
    return [
        (_Polygons(vertices, corners, counts, limits), matrices[shown == number])
        for number, (vertices, corners, counts) in enumerate(zip(*columns, strict=True))
    ]
