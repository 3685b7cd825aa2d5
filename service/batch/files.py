"""Mesh files to classify: of this machine, behind URLs, and on standard input.

fsspec, which comes with an extra, is imported where a URL is used.
"""

import errno
import os
import socket
import stat
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace
from functools import cache, cached_property, lru_cache, partial
from pathlib import Path
from typing import Any

from meshconv3d.model.errors import MeshError
from meshconv3d.model.loading import (
    Limits,
    MeshArchive,
    find_pieces,
    is_hidden,
    read_beside,
    walk_files,
)
from meshconv3d.service.records import readable

# Of archives and of the files beside a mesh.
LIMITS = Limits()
NO_FILE = "it is no file; pipe what it holds to -"


@dataclass(frozen=True)
class File:
    """A file that was listed. Small, and can be sent to other processes: the bytes are read where
    they are needed.

    name: as its record has it. below: its path from where it was found, with slashes. declared:
    its extension or format, or None.
    """

    name: str
    below: str
    declared: str | None

    def size(self) -> int:
        """In bytes; 0 where that is not known before it is read."""
        return 0

    def read(self) -> bytes:
        """All of it. Raises OSError."""
        raise NotImplementedError

    def pieces(self, content: bytes) -> dict[str, bytes]:
        """The files beside it that its content refers to, by their paths relative to it. Raises
        MeshError and OSError."""
        return {}

    def shared(self) -> "File":
        """The same for other machines, which have another current folder."""
        return self


class StandardInput(File):
    """The one mesh that standard input holds."""

    def read(self) -> bytes:
        return sys.stdin.buffer.read()


@dataclass(frozen=True)
class LocalFile(File):
    """A file of this machine. host: where it was listed, if other machines may read it."""

    path: str
    host: str | None = None

    @classmethod
    def at(cls, path: str, root: str | None = None, declared: str | None = None) -> "LocalFile":
        """root: the folder in which it was found; None for a file that was named."""
        below = os.path.relpath(path, root) if root else os.path.basename(path)
        return cls(
            readable(path), readable(below), declared or os.path.splitext(path)[1], path=path
        )

    def shared(self) -> "LocalFile":
        return replace(self, path=os.path.join(os.getcwd(), self.path), host=socket.gethostname())

    def size(self) -> int:
        try:
            return os.stat(self.path).st_size
        except OSError:
            return 0  # reading it says why

    def read(self) -> bytes:
        """Raises OSError, also for what is no file any more: reading a pipe might never end."""
        try:
            with open(self.path, "rb", opener=_without_waiting) as file:
                if not stat.S_ISREG(os.fstat(file.fileno()).st_mode):
                    raise OSError(errno.EINVAL, NO_FILE)
                return file.read()
        except FileNotFoundError as error:
            this = socket.gethostname()
            if self.host in (None, this):
                raise
            raise FileNotFoundError(
                error.errno,
                f"{self.host} has it and {this} has not; put the files where every machine of the "
                "cluster sees them by the same path, or name them by URLs",
            ) from None

    def pieces(self, content: bytes) -> dict[str, bytes]:
        return find_pieces(content, partial(read_beside, Path(self.path), LIMITS), LIMITS)


def _without_waiting(path: str, flags: int) -> int:
    return os.open(path, flags | os.O_NONBLOCK)


@dataclass(frozen=True)
class RemoteFile(File):
    """A file behind a URL. url: that by which it was found. length: in bytes; None where the
    listing does not tell, as over HTTP."""

    url: str
    path: str
    length: int | None

    @cached_property
    def _size(self) -> int | None:
        if self.length is not None:
            return self.length
        fs, _ = filesystem(self.url)
        with remote_errors():
            return fs.size(self.path)

    def size(self) -> int:
        try:
            return self._size or 0
        except OSError:
            return 0  # reading it says why

    def read(self) -> bytes:
        fs, _ = filesystem(self.url)
        if self._size is None:
            raise OSError(errno.EIO, "its server does not tell how large it is")
        with remote_errors():
            return fs.cat_file(self.path)

    def pieces(self, content: bytes) -> dict[str, bytes]:
        return find_pieces(content, self._beside, LIMITS)

    def _beside(self, piece: str) -> bytes | None:
        fs, _ = filesystem(self.url)
        path = f"{self.path.rpartition('/')[0]}/{piece}"
        with remote_errors():
            if not fs.exists(path):
                return None
            LIMITS.check("piece_bytes", fs.size(path) or 0)
            return fs.cat_file(path)


@dataclass(frozen=True)
class ArchivedFile(File):
    """A mesh file in a ZIP archive. archive: a file itself; member: its path in there."""

    archive: File
    member: str

    def shared(self) -> "ArchivedFile":
        return replace(self, archive=self.archive.shared())

    def size(self) -> int:
        try:
            return opened(self.archive).size(self.member)
        except (MeshError, OSError):
            return 0  # reading it says why

    def read(self) -> bytes:
        """Raises MeshError and OSError."""
        return opened(self.archive).read(self.member)

    def pieces(self, content: bytes) -> dict[str, bytes]:
        return opened(self.archive).pieces(self.member, content)


def members(archive: File) -> list[File]:
    """The mesh files in a ZIP archive, and files of other 3D formats. Raises MeshError and
    OSError."""
    found: list[File] = []
    held = opened(archive)
    for member in sorted(held.names + held.others):
        name, below = (f"{path}/{readable(member)}" for path in (archive.name, archive.below))
        found.append(ArchivedFile(name, below, os.path.splitext(member)[1], archive, member))
    return found


def opened(archive: File) -> MeshArchive:
    """A ZIP archive. Raises MeshError and OSError."""
    changed = os.stat(archive.path).st_mtime_ns if isinstance(archive, LocalFile) else None
    return _opened(archive, changed)


@lru_cache(maxsize=1)
def _opened(archive: File, changed: int | None) -> MeshArchive:
    """The archive, kept for the next file in it. changed: when that was, if it is known."""
    if isinstance(archive, LocalFile):
        return MeshArchive(open(archive.path, "rb", opener=_without_waiting), LIMITS)
    return MeshArchive(archive.read(), LIMITS)


def is_url(path: str) -> bool:
    """Whether a path names its protocol, as `s3://bucket/folder` does."""
    return "://" in path


@cache
def filesystem(url: str) -> tuple[Any, str]:
    """The file system of a URL, as fsspec has it, and the path in it. Raises OSError."""
    import fsspec

    with remote_errors():
        return fsspec.url_to_fs(url)


@contextmanager
def remote_errors() -> Iterator[None]:
    """Within it, errors of fsspec's file systems, many of them of their own kinds, are OSErrors
    with a text that can be shown."""
    try:
        yield
    except FileNotFoundError as error:
        raise OSError(errno.ENOENT, os.strerror(errno.ENOENT)) from error
    except Exception as error:
        text = getattr(error, "strerror", None) or f"{type(error).__name__}: {error}"
        raise OSError(getattr(error, "errno", None) or errno.EIO, text) from error


def exists(path: str) -> bool:
    """Whether there is anything at a path or URL, be it a broken link. Raises OSError."""
    if not is_url(path):
        return os.path.lexists(path)
    fs, inner = filesystem(path)
    with remote_errors():
        fs.invalidate_cache()
        return fs.exists(inner)


def is_folder(path: str) -> bool | None:
    """True for the path or URL of a folder, False for a file, None for nothing. Raises OSError."""
    if is_url(path):
        fs, inner = filesystem(path)
        with remote_errors():
            return True if fs.isdir(inner) else False if fs.exists(inner) else None
    if not os.path.exists(path):
        return None
    if not os.path.isdir(path) and not os.path.isfile(path):
        raise OSError(errno.EINVAL, NO_FILE)  # a device may have no end, a pipe can be read once
    return os.path.isdir(path)


def file_at(path: str, declared: str | None = None) -> File:
    """The file that a path or URL names. declared: its format, or None. Raises OSError."""
    if not is_url(path):
        return LocalFile.at(path, declared=declared)
    fs, inner = filesystem(path)
    with remote_errors():
        return _remote_file(path, path, inner.rpartition("/")[2], fs.info(inner), declared)


def walk(folder: str) -> Iterator[File]:
    """All files under a folder or a URL but hidden ones, one by one, sorted by path. Raises
    OSError."""
    if not is_url(folder):
        return (LocalFile.at(str(path), folder) for path in walk_files(Path(folder)))
    return _walk_remote(folder)


def _walk_remote(folder: str) -> Iterator[RemoteFile]:
    fs, root = filesystem(folder)
    _, chain, outer = folder.partition("::")  # of a file in an archive, where the archive lies
    with remote_errors():
        levels = [_listed(fs, root)]
        while levels:
            for info in levels[-1]:
                path = info["name"]
                if info["type"] == "directory":
                    levels.append(_listed(fs, path))
                    break
                below = path.removeprefix(root).lstrip("/")
                url = f"{fs.unstrip_protocol(path)}{chain}{outer}"
                yield _remote_file(folder, url, below, info)
            else:
                levels.pop()


def _listed(fs: Any, folder: str) -> Iterator[dict[str, Any]]:
    """The files and folders in a folder but hidden ones, as fsspec describes them, sorted."""
    found = {info["name"].rstrip("/"): info for info in fs.ls(folder, detail=True)}
    fs.invalidate_cache(folder)  # which would grow with every folder
    found.pop(folder.rstrip("/"), None)  # an object store may have an object in place of a folder
    return iter(found[name] for name in sorted(found) if not is_hidden(name.rpartition("/")[2]))


def _remote_file(
    url: str, name: str, below: str, info: dict[str, Any], declared: str | None = None
) -> RemoteFile:
    path = info["name"]
    extension = declared or os.path.splitext(path)[1]
    return RemoteFile(name, below, extension, url=url, path=path, length=info["size"])
