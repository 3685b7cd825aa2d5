"""The mesh files of a folder."""

import logging
import os
from collections.abc import Iterator
from pathlib import Path

from meshconv3d.model.loading.formats import FORMATS

log = logging.getLogger(__name__)

# Extensions of 3D formats that are not read. Files of these are counted and named where a folder is
# listed; other files beside meshes, such as .mtl, pictures and text, are not.
_OTHER_FORMATS = """
3dm 3ds 3dxml abc amf blend brep c4d catpart catproduct ctm dae drc dwg dxf e57 f3d fbx fcstd iam
ifc iges igs ipt iv jt las laz lwo lxo ma max mb mesh msh pcd prt pts sab sat skp sldasm sldprt step
stp u3d usd usda usdc usdz vrm vrml vtk vtp vtu wrl wrz x x3d x3dv x_b x_t xyz zpr ztl
"""
OTHER_FORMATS = frozenset(_OTHER_FORMATS.split())


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
    return extension(name) in FORMATS


def has_other_format(name: str) -> bool:
    """Whether the extension of a file's name is that of a 3D format that is not read."""
    return extension(name) in OTHER_FORMATS


def extension(name: str) -> str:
    """The part of a file's name after its last dot, in small letters."""
    return os.path.splitext(name)[1].lower().lstrip(".")


def _is_file(entry: os.DirEntry[str]) -> bool:
    leads_nowhere = entry.is_symlink() and not os.path.exists(entry)
    return leads_nowhere or entry.is_file()  # which a link that leads to itself has no answer to
