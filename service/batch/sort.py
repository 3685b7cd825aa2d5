"""Sorting of files into folders by their results: DIR/CLASS, DIR/unknown, DIR/refused/FAULT.

Where a file goes follows from its own name and record alone. So any number of processes may sort
into one folder, and a run that starts again finds its own links.
"""

import errno
import hashlib
import os
import re
import shutil
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import BinaryIO

from meshconv3d.service.batch.files import File, LocalFile
from meshconv3d.service.batch.running import FileResult
from meshconv3d.service.output_files import errors_naming
from meshconv3d.service.prediction import Failure, Result

# How many names below DIR a file lies: CLASS/FILE, refused/FAULT/FILE.
DEPTHS = (2, 3)

# Folders that are no classes. A class of this name gets another.
UNKNOWN, REFUSED = "unknown", "refused"

# What a name in a folder may not hold: all but letters and digits of any script, and what no system
# takes for more than itself; no space or dot at its ends.
UNSAFE = re.compile(r"[^\w .,()+\-]|^[. ]|[. ]$")

# Bytes of a name. Systems take 255; that leaves room for a digest, an ending, and `.part`.
LONGEST = 200
DIGEST = 16  # hexadecimal digits: some collections hold a million files of one name
ENDING = re.compile(r"(.*?)(\.[a-zA-Z0-9]{1,16})?", re.DOTALL)

FOLDER = os.O_RDONLY | os.O_DIRECTORY | os.O_NOFOLLOW


class SortedFolder:
    """A folder that is filled with classified files; nothing outside it is written or removed.

    Folders in it are opened one in the other, and never through a link.
    """

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
        name = _file_name(file)
        place = self.folder.joinpath(*folders, name)
        self.folder.mkdir(parents=True, exist_ok=True)
        with errors_naming(place), _opened(self.folder, folders) as folder:
            if isinstance(file, LocalFile):
                _link(Path(file.path).absolute(), name, folder)
            else:
                content = file.read()
                _write(lambda new: new.write(content), name, folder)
        self._forget_refusals(name, folders)
        return place

    def _forget_refusals(self, name: str, kept: tuple[str, ...]) -> None:
        """Remove a file from the other folders of refusals: an earlier run may have refused it."""
        absent = suppress(FileNotFoundError, NotADirectoryError)
        with absent, _opened(self.folder, (REFUSED,), make=False) as refused:
            for fault in os.listdir(refused):
                if (REFUSED, fault) != kept:
                    with absent, _opened_below(fault, refused, make=False) as folder:
                        os.unlink(name, dir_fd=folder)


@contextmanager
def _opened(root: Path, names: tuple[str, ...], make: bool = True) -> Iterator[int]:
    """A folder below a root, as a descriptor. Raises OSError where a link is on the way."""
    number = os.open(root, os.O_RDONLY | os.O_DIRECTORY)
    try:
        for name in names:
            with _opened_below(name, number, make) as below:
                os.dup2(below, number, inheritable=False)
        yield number
    finally:
        os.close(number)


@contextmanager
def _opened_below(name: str, folder: int, make: bool) -> Iterator[int]:
    if make:
        with suppress(FileExistsError):
            os.mkdir(name, dir_fd=folder)
    try:
        number = os.open(name, FOLDER, dir_fd=folder)
    except OSError as error:
        if error.errno in (errno.ENOTDIR, errno.ELOOP):
            error.strerror = f"{name} is no folder, or a link to one"
        raise
    try:
        yield number
    finally:
        os.close(number)


def _link(source: Path, name: str, folder: int) -> None:
    with suppress(OSError):
        if os.readlink(name, dir_fd=folder) == str(source):
            return
    new = f".{name}.part"
    with suppress(FileNotFoundError):
        os.unlink(new, dir_fd=folder)  # of a run that was killed
    try:
        os.symlink(source, new, dir_fd=folder)
    except OSError:
        with open(source, "rb") as file:
            _write(lambda new: shutil.copyfileobj(file, new), name, folder)
    else:
        os.rename(new, name, src_dir_fd=folder, dst_dir_fd=folder)


def _write(write: Callable[[BinaryIO], object], name: str, folder: int) -> None:
    """Fill a place at one moment: it holds the old file or the whole new one."""
    new = f".{name}.part"
    with suppress(FileNotFoundError):
        os.unlink(new, dir_fd=folder)
    flags = os.O_WRONLY | os.O_CREAT | os.O_EXCL
    with open(os.open(new, flags, 0o666, dir_fd=folder), "wb") as file:
        write(file)
    os.rename(new, name, src_dir_fd=folder, dst_dir_fd=folder)


def _folders(result: Result) -> tuple[str, ...]:
    if isinstance(result, Failure):
        return REFUSED, _safe(result.fault)
    if result.unknown:
        return (UNKNOWN,)
    name = _safe(result.label)
    # As a system sees it that does not tell large letters from small ones.
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
