"""Output files: never written through a link; one that replaces a file is whole, or not there."""

import errno
import os
import stat
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import BinaryIO


@contextmanager
def errors_naming(path: str | Path) -> Iterator[None]:
    """Within it, an OSError that names no file, as of a full disk, names this one."""
    try:
        yield
    except OSError as error:
        error.filename = error.filename or str(path)
        raise


def open_to_append(path: Path) -> BinaryIO:
    """A file that is made, or added to. Raises OSError, also for a link and for what is no file.

    Another user of the folder could place a link there, to have another file written to.
    """
    if path.is_symlink():
        raise OSError(errno.ELOOP, "it is a link; name the file that it leads to", str(path))
    flags = os.O_RDWR | os.O_APPEND | os.O_CREAT | os.O_NOFOLLOW | os.O_NONBLOCK
    number = os.open(path, flags, 0o666)
    if not stat.S_ISREG(os.fstat(number).st_mode):
        os.close(number)
        raise OSError(errno.EINVAL, "it is no file", str(path))
    return open(number, "r+b")


@contextmanager
def replacing(path: Path) -> Iterator[BinaryIO]:
    """A new file beside a path, which takes its place at the end; after an error, it is removed.

    A link in that place is replaced, and what it leads to stays. Raises OSError.
    """
    with errors_naming(path):
        number, new = tempfile.mkstemp(prefix=".meshconv3d-", dir=path.parent)
        try:
            with open(number, "wb") as file:
                yield file
                file.flush()
                os.fchmod(number, _mode(path))
                os.fsync(number)
            os.replace(new, path)
        except BaseException:
            os.unlink(new)
            raise


def _mode(path: Path) -> int:
    """Permissions of the file that is replaced, or those of any new one."""
    if path.is_file() and not path.is_symlink():
        return stat.S_IMODE(path.stat().st_mode)
    umask = os.umask(0)
    os.umask(umask)
    return 0o666 & ~umask
