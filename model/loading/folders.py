"""The mesh files of a folder."""

import logging
import os
from collections.abc import Iterator
from pathlib import Path

from meshconv3d.model.loading.formats import FORMATS

log = logging.getLogger(__name__)


def find_meshes(folder: Path) -> list[Path]:
    """Every file that `walk_meshes` finds."""
    return list(walk_meshes(folder))


def walk_meshes(folder: Path) -> Iterator[Path]:
    """The files under `folder` whose extension is one that is read, one by one, sorted by path.

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
            if has_mesh_name(entry.name) and _is_file(entry):
                yield Path(entry.path)
        else:
            levels.pop()


def _listed(folder: Path) -> Iterator[os.DirEntry[str]]:
    try:
        with os.scandir(folder) as found:
            return iter(sorted(found, key=lambda entry: entry.name))
    except OSError as error:
        log.warning("%s cannot be listed, and is passed over: %s", folder, error.strerror)
        return iter(())


def has_mesh_name(name: str) -> bool:
    """Whether the extension of a file's name is one that is read."""
    return os.path.splitext(name)[1].lower().lstrip(".") in FORMATS


def _is_file(entry: os.DirEntry[str]) -> bool:
    leads_nowhere = entry.is_symlink() and not os.path.exists(entry)
    return leads_nowhere or entry.is_file()  # which a link that leads to itself has no answer to
