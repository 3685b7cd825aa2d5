"""Files sorted into folders by what they are: DIR/CLASS, DIR/unknown, DIR/refused/FAULT.

Where a file goes follows from its own name and record alone. So any number of processes may sort
into one folder, and a run that starts again finds its own links.
"""

import errno
import glob
import hashlib
import os
import re
import shutil
from collections.abc import Callable
from pathlib import Path

from meshconv3d.service.records import Answer, Refusal

# How many names below DIR a file lies: CLASS/FILE, refused/FAULT/FILE.
DEPTHS = (2, 3)

# Folders that are no classes. A class of this name gets another.
UNKNOWN, REFUSED = "unknown", "refused"

# What a name in a folder may hold: letters and digits of any script, and what no system takes for
# more than itself; no space or dot at its ends.
UNSAFE = re.compile(r"[^\w .,()+\-]|^[. ]|[. ]$")

# Bytes of a name. Systems take 255; that leaves room for a digest, an ending, and `.part`.
LONGEST = 200
DIGEST = 16  # hexadecimal digits: some collections hold a million files of one name
ENDING = re.compile(r"(.*?)(\.[a-zA-Z0-9]{1,16})?", re.DOTALL)


class SortedFolder:
    """A folder that is filled with classified files; nothing is ever written outside it."""

    def __init__(self, folder: Path) -> None:
        """folder: made with the first file that is placed in it."""
        self.folder = folder
        self._inside = folder.resolve()

    def place(self, record: Answer | Refusal, source: Path | bytes) -> Path:
        """Put a file where its record says. Returns its place.

        A file on this machine becomes a symbolic link to it, or a copy where the system makes no
        links; bytes from elsewhere are written. Placing a file again changes nothing. Raises
        OSError where that cannot be done.
        """
        name = record.file or "-"
        if isinstance(source, bytes):
            place = self._place(record, name, name.encode())
            _replace(place, lambda new: new.write_bytes(source))
        else:
            path = source.absolute()
            place = self._place(record, name, os.fsencode(path))
            if not (place.is_symlink() and place.readlink() == path):
                _replace(place, lambda new: _link(path, new))
        self._forget_refusals(place)
        return place

    def _forget_refusals(self, place: Path) -> None:
        """Have a file in this place alone: an earlier run may have refused it, for what passes."""
        for earlier in (self.folder / REFUSED).glob(f"*/{glob.escape(place.name)}"):
            if earlier != place:
                earlier.unlink(missing_ok=True)

    def _place(self, record: Answer | Refusal, name: str, identity: bytes) -> Path:
        """Where a file belongs. identity: what tells it from others of its name."""
        folder = self.folder.joinpath(*_folders(record))
        if not folder.resolve().is_relative_to(self._inside):
            raise OSError(errno.EXDEV, "it is a link that leads out of the folder", str(folder))
        digest = hashlib.sha256(identity).hexdigest()[:DIGEST]
        return folder / _file_name(name, digest)


def _folders(record: Answer | Refusal) -> tuple[str, ...]:
    if isinstance(record, Refusal):
        return REFUSED, _safe(record.error.fault)
    if record.unknown:
        return (UNKNOWN,)
    name = _safe(record.class_)
    # As a system sees it that does not tell large letters from small ones.
    if name.casefold() in (UNKNOWN, REFUSED):
        return (f"%{ord(name[0]):02X}{name[1:]}",)
    return (name,)


def _file_name(name: str, digest: str) -> str:
    """The last part of a name with a digest before its ending: two folders may hold an `a.obj`."""
    found = ENDING.fullmatch(re.split(r"[/\\]", name)[-1])
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


def _replace(place: Path, write: Callable[[Path], object]) -> None:
    """Fill a place at one moment: whoever looks finds the old file or the whole new one."""
    place.parent.mkdir(parents=True, exist_ok=True)
    new = place.with_name(f".{place.name}.part")
    new.unlink(missing_ok=True)  # of a run that was killed
    write(new)
    new.replace(place)


def _link(source: Path, place: Path) -> None:
    try:
        place.symlink_to(source)
    except OSError:
        shutil.copyfile(source, place)
