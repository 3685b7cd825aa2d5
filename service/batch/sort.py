"""Sorting of files into folders by their results: DIR/CLASS, DIR/unknown, DIR/refused/FAULT.

The place of a file depends on its own name and record alone: any number of processes may sort into
one folder, and a run that starts again finds its own links.
"""

import errno
import hashlib
import os
import re
import shutil
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path

from meshconv3d.model.files import errors_naming
from meshconv3d.service.batch.files import File, LocalFile
from meshconv3d.service.batch.running import FileResult
from meshconv3d.service.prediction import Failure, Result

# How many names below DIR a file lies: CLASS/FILE, refused/FAULT/FILE.
DEPTHS = (2, 3)

# Folders that are no classes. A class of such a name gets another folder.
UNKNOWN, REFUSED = "unknown", "refused"

# Characters that a name may not hold: all but letters and digits of any script, and punctuation
# without a meaning in paths; at the ends, spaces and dots.
UNSAFE = re.compile(r"[^\w .,()+\-]|^[. ]|[. ]$")

# Bytes of a name. Systems take 255; that leaves room for a digest, an ending, and `.part`.
LONGEST = 200
DIGEST = 16  # hexadecimal digits: some collections hold a million files of one name
ENDING = re.compile(r"(.*?)(\.[a-zA-Z0-9]{1,16})?", re.DOTALL)


class SortedFolder:
    """Folder of classified files. Nothing outside it is written or removed: links to folders in it
    are refused."""

    def __init__(self, folder: Path) -> None:
        """folder: made with the first file that is placed in it."""
        self.folder = folder

    def place(self, one: FileResult) -> Path | None:
        """Put a file where its result says. Returns its place.

        A file of this machine becomes a symbolic link to it, or a copy where the system makes no
        links; others are read and written, but for those that could not be read. Placing a file
        again changes nothing. Raises OSError where that cannot be done.
        """
        file = one.file
        if not isinstance(file, LocalFile) and one.sha256 is None:
            return None
        folders = _folders(one.result)
        place = self.folder.joinpath(*folders, _file_name(file))
        with errors_naming(place):
            self.folder.mkdir(parents=True, exist_ok=True)
            for parent in reversed(place.relative_to(self.folder).parents[:-1]):
                _make(self.folder / parent)
            if isinstance(file, LocalFile):
                _link(Path(file.path).absolute(), place)
            else:
                content = file.read()
                _replace(place, lambda new: new.write_bytes(content))
        self._forget_refusals(place)
        return place

    def _forget_refusals(self, kept: Path) -> None:
        """Remove a file from the other folders of refusals: an earlier run may have refused it."""
        refused = self.folder / REFUSED
        for fault in refused.iterdir() if _is_own(refused) else ():
            if fault != kept.parent and _is_own(fault):
                (fault / kept.name).unlink(missing_ok=True)


def _is_own(folder: Path) -> bool:
    """Whether it is a folder, and no link to one."""
    return folder.is_dir() and not folder.is_symlink()


def _make(folder: Path) -> None:
    """Make a folder, unless it exists. Raises OSError for a link in its place."""
    with suppress(FileExistsError):
        folder.mkdir()
    if not _is_own(folder):
        raise OSError(errno.ENOTDIR, f"{folder.name} is no folder, or a link to one")


def _link(source: Path, place: Path) -> None:
    """Link to a file, or copy it where links cannot be made."""
    if place.is_symlink() and os.readlink(place) == str(source):
        return
    try:
        _replace(place, lambda new: os.symlink(source, new))
    except OSError:
        _replace(place, lambda new: shutil.copyfile(source, new))


def _replace(place: Path, fill: Callable[[Path], object]) -> None:
    """Fill a place atomically: it holds the old file or the whole new one."""
    new = place.with_name(f".{place.name}.part")
    new.unlink(missing_ok=True)  # of a run that was killed
    fill(new)
    os.replace(new, place)


def _folders(result: Result) -> tuple[str, ...]:
    if isinstance(result, Failure):
        return REFUSED, _safe(result.fault)
    if result.unknown:
        return (UNKNOWN,)
    name = _safe(result.label)
    # Some file systems ignore case.
    if name.casefold() in (UNKNOWN, REFUSED):
        return (f"%{ord(name[0]):02X}{name[1:]}",)
    return (name,)


def _file_name(file: File) -> str:
    """Its own name, with a digest before the ending: two folders may both hold an `a.obj`."""
    whole = Path(file.path).absolute() if isinstance(file, LocalFile) else file.name
    digest = hashlib.sha256(os.fsencode(whole)).hexdigest()[:DIGEST]
    found = ENDING.fullmatch(re.split(r"[/\\]", file.below)[-1])
    assert found is not None  # it matches any text
    stem, ending = found[1], found[2] or ""
    return ".".join(filter(None, (_cut(_escaped(stem)), digest))) + ending


def _safe(name: str) -> str:
    """A name as one part of a path; different names stay different."""
    escaped = _escaped(name) or "%"
    if len(escaped.encode()) <= LONGEST:
        return escaped
    return f"{_cut(escaped)}.{hashlib.sha256(escaped.encode()).hexdigest()[:DIGEST]}"


def _escaped(name: str) -> str:
    """A name with the bytes of each unsafe character as in a URL; % is one of them."""
    return UNSAFE.sub(lambda found: "".join(f"%{byte:02X}" for byte in found[0].encode()), name)


def _cut(name: str) -> str:
    return name.encode()[:LONGEST].decode(errors="ignore")
