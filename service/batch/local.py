"""Files of this machine."""

import errno
import os
import stat
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

from meshconv3d.model.loading import walk_meshes
from meshconv3d.service.batch.entries import Entry
from meshconv3d.service.batch.patterns import split_glob
from meshconv3d.service.records import readable

NO_FILE = "it is no file; pipe what it holds to -"


@dataclass(frozen=True)
class LocalFile:
    """A file of this machine. root: the folder in which it was found; None for one that was
    named."""

    path: str
    root: Path | None = None

    @property
    def name(self) -> str:
        return readable(self.path)

    @property
    def below(self) -> str:
        path = Path(self.path)
        return readable(path.relative_to(self.root or path.parent).as_posix())

    @property
    def declared(self) -> str | None:
        return Path(self.path).suffix

    @property
    def local(self) -> Path:
        return Path(self.path)

    def size(self) -> int:
        try:
            return os.stat(self.path).st_size
        except OSError:
            return 0  # reading it says why

    def read(self) -> bytes:
        """Raises OSError, as for what is no file any more: a pipe would keep who reads it."""
        with open(self.path, "rb", opener=_at_once) as file:
            if not stat.S_ISREG(os.fstat(file.fileno()).st_mode):
                raise OSError(errno.EINVAL, NO_FILE)
            return file.read()


def _at_once(path: str, flags: int) -> int:
    return os.open(path, flags | os.O_NONBLOCK)


class LocalSource:
    """See `Source`."""

    def kind(self, path: str) -> Literal["file", "folder"] | None:
        if os.path.isdir(path):
            return "folder"
        if os.path.exists(path) and not os.path.isfile(path):
            # A device may have no end, and a pipe can be read once.
            raise OSError(errno.EINVAL, NO_FILE)
        return "file" if os.path.isfile(path) else None

    def file(self, path: str) -> Entry:
        return LocalFile(path)

    def walk(self, folder: str) -> Iterator[Entry]:
        root = Path(folder)
        return (LocalFile(str(path), root) for path in walk_meshes(root))

    def split_glob(self, path: str) -> tuple[str, str]:
        return split_glob(path)


LOCAL = LocalSource()
