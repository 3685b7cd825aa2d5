"""Mesh files where they lie, in folders and archives, and the pieces that lie beside them."""

import logging
import os
from collections.abc import Callable, Iterator
from pathlib import Path, PurePosixPath
from typing import BinaryIO

from meshconv3d.model.errors import MalformedFile
from meshconv3d.model.loading.archive import Archive
from meshconv3d.model.loading.formats import ARCHIVE, FORMATS, named_format
from meshconv3d.model.loading.gltf import piece_names
from meshconv3d.model.loading.limits import Limits

log = logging.getLogger(__name__)

# Extensions of 3D formats that are not read. Files of these are counted and named where a folder is
# listed; other files beside meshes, such as .mtl, pictures and text, are not.
_OTHER_FORMATS = """
3dm 3ds 3dxml abc blend brep c4d catpart catproduct ctm dae drc dwg dxf e57 f3d fbx fcstd iam
ifc iges igs ipt iv jt las laz lwo lxo ma max mb mesh msh pcd prt pts sab sat skp sldasm sldprt step
stp u3d usd usda usdc usdz vrm vrml vtk vtp vtu wrl wrz x x3d x3dv x_b x_t xyz zpr ztl
"""
OTHER_FORMATS = frozenset(_OTHER_FORMATS.split())

# What a glTF file begins with lies behind blanks and the mark of UTF-8, within so many bytes.
_STARTS, _BLANKS = 64, b" \t\r\n\xef\xbb\xbf"


def find_meshes(folder: Path) -> list[Path]:
    """Every file that `walk_meshes` finds."""
    return list(walk_meshes(folder))


def walk_meshes(folder: Path) -> Iterator[Path]:
    """The files of `walk_files` whose extension is one that is read."""
    return (path for path in walk_files(folder) if has_mesh_name(path.name))


def walk_files(folder: Path) -> Iterator[Path]:
    """The files under `folder`, one by one, sorted by path; hidden ones are passed over.

    At a time, the names in one folder and in those above it are held. A subfolder that cannot be
    listed is logged and passed over. Links to folders are not followed; what is no file, such as
    a pipe, is left out, but not a link that leads nowhere.
    """
    levels = [_listed(folder)]
    while levels:
        for entry in levels[-1]:
            if entry.is_dir(follow_symlinks=False):
                levels.append(_listed(Path(entry.path)))
                break
            if _is_file(entry):
                yield Path(entry.path)
        else:
            levels.pop()


def _listed(folder: Path) -> Iterator[os.DirEntry[str]]:
    try:
        with os.scandir(folder) as found:
            shown = (entry for entry in found if not is_hidden(entry.name))
            return iter(sorted(shown, key=lambda entry: entry.name))
    except OSError as error:
        log.warning("%s cannot be listed, and is passed over: %s", folder, error.strerror)
        return iter(())


def is_hidden(name: str) -> bool:
    """Whether a system keeps a file or folder of this name for itself: macOS's `._a.obj` and
    `__MACOSX`, and all else that begins with a dot."""
    return name.startswith(".") or name == "__MACOSX"


def has_mesh_name(name: str) -> bool:
    """Whether the extension of a file's name is one that is read."""
    known = named_format(extension(name))
    return known is not None and known.extension in FORMATS


def has_other_format(name: str) -> bool:
    """Whether the extension of a file's name is that of a 3D format that is not read."""
    return extension(name) in OTHER_FORMATS and not has_mesh_name(name)


def extension(name: str) -> str:
    """The part of a file's name after its last dot, in small letters."""
    return os.path.splitext(name)[1].lower().lstrip(".")


class MeshArchive:
    """The mesh files in a ZIP archive. Hidden files and archives within it are passed over.

    source: its bytes, or a file that is open for reading and stays open.
    names: paths of the mesh files, sorted. others: those of files of other 3D formats.

    Raises MalformedFile and LimitExceeded.
    """

    def __init__(self, source: bytes | BinaryIO, limits: Limits) -> None:
        self._archive = Archive(source, limits, _within)
        self._limits = limits
        shown = [
            name for name in sorted(self._archive.names) if not any(map(is_hidden, name.split("/")))
        ]
        self.names = [
            name for name in shown if has_mesh_name(name) and extension(name) != ARCHIVE.extension
        ]
        self.others = list(filter(has_other_format, shown))

    def check_any(self) -> None:
        """Raises MalformedFile where there is no mesh file."""
        if not self.names:
            raise MalformedFile(
                "no-meshes",
                "the ZIP archive holds no file of a format that is read; archives within it are "
                "not opened",
            )

    def size(self, name: str) -> int:
        """Bytes of a mesh file, as the archive declares it."""
        return self._archive.size(name)

    def read(self, name: str) -> bytes:
        """The content of a mesh file. Raises MalformedFile and LimitExceeded."""
        return self._archive.content(name)

    def pieces(self, name: str, content: bytes) -> dict[str, bytes]:
        """What `find_pieces` finds beside a mesh file of this content."""
        folder = PurePosixPath(name).parent

        def sibling(piece: str) -> bytes | None:
            path = str(folder / piece)
            return self._archive.content(path) if path in self._archive else None

        return find_pieces(content, sibling, self._limits)


def find_pieces(
    data: bytes, read: Callable[[str], bytes | None], limits: Limits
) -> dict[str, bytes]:
    """The other files in which a mesh file keeps its buffers, by their paths relative to it.

    Files that are not there are left out: the reader says which it misses.

    read: gives the content of the file with such a path, which never leads out of the mesh file's
        folder, or None where there is none.

    Raises LimitExceeded, and what `read` raises.
    """
    if not data[:_STARTS].lstrip(_BLANKS).startswith((b"{", b"glTF")):
        return {}
    pieces: dict[str, bytes] = {}
    for name in piece_names(data, limits):
        content = read(name)
        if content is not None:
            pieces[name] = content
            limits.check("piece_bytes", sum(map(len, pieces.values())))
    return pieces


def read_beside(mesh: Path, limits: Limits, piece: str) -> bytes | None:
    """The content of a file in the folder of a mesh file or below; None where there is none.

    Links are followed within that folder alone; what is no file, such as a pipe, is not read.

    Raises LimitExceeded and OSError.
    """
    folder = mesh.parent.resolve()
    path = (folder / piece).resolve()
    if not path.is_relative_to(folder) or not path.is_file():
        return None
    with path.open("rb") as file:
        limits.check("piece_bytes", os.fstat(file.fileno()).st_size)
        return file.read(limits.piece_bytes)


def _within(path: str) -> str:
    """A path without the parts that lead out of an archive."""
    return "/".join(part for part in path.split("/") if part not in ("", ".", ".."))


def _is_file(entry: os.DirEntry[str]) -> bool:
    leads_nowhere = entry.is_symlink() and not os.path.exists(entry)
    return leads_nowhere or entry.is_file()  # which a link that leads to itself has no answer to
