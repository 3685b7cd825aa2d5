"""Atomic writing of files: a file that replaces another is whole, or not there."""

import os
import stat
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import BinaryIO


def write_whole(path: Path, content: bytes) -> None:
    """Write atomically, see `replacing`."""
    with replacing(path) as file:
        file.write(content)


@contextmanager
def replacing(path: Path) -> Iterator[BinaryIO]:
    """A new file, which replaces the one at a path at the end; after an error, it is removed.

    A link at the path is replaced, not followed. Raises OSError.
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


@contextmanager
def errors_naming(path: str | Path) -> Iterator[None]:
    """Within it, an OSError that names no file, as of a full disk, names this one."""
    try:
        yield
    except OSError as error:
        error.filename = error.filename or str(path)
        raise


def _mode(path: Path) -> int:
    """Permissions of the file that is replaced, or those of any new one."""
    if path.is_file() and not path.is_symlink():
        return stat.S_IMODE(path.stat().st_mode)
    umask = os.umask(0)
    os.umask(umask)
    return 0o666 & ~umask
