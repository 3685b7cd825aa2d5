"""Files of other machines and in archives, by URL: whatever fsspec can open.

fsspec comes with an extra, and is imported where a URL is used.
"""

import errno
import os
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from functools import cache, cached_property
from typing import Any, Literal

from meshconv3d.model.loading import has_mesh_name
from meshconv3d.service.batch.entries import Entry
from meshconv3d.service.batch.patterns import split_glob


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
    """What fsspec's file systems raise, many of them errors of their own, becomes OSError with a
    text that can be shown."""
    try:
        yield
    except FileNotFoundError as error:
        raise OSError(errno.ENOENT, os.strerror(errno.ENOENT)) from error
    except Exception as error:
        text = getattr(error, "strerror", None) or f"{type(error).__name__}: {error}"
        raise OSError(getattr(error, "errno", None) or errno.EIO, text) from error


@dataclass(frozen=True)
class RemoteFile:
    """A file behind a URL. url: that by which it was found. length: in bytes; None where the
    listing does not tell, as over HTTP."""

    url: str
    path: str
    name: str
    below: str
    length: int | None
    local: None = None

    @property
    def declared(self) -> str | None:
        return os.path.splitext(self.path)[1]

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
            raise OSError(errno.EIO, "nobody tells how large the file is")
        with remote_errors():
            return fs.cat_file(self.path)


class RemoteSource:
    """See `Source`."""

    def kind(self, path: str) -> Literal["file", "folder"] | None:
        fs, inner = filesystem(path)
        with remote_errors():
            if fs.isdir(inner):
                return "folder"
            return "file" if fs.exists(inner) else None

    def file(self, path: str) -> Entry:
        fs, inner = filesystem(path)
        with remote_errors():
            return _file(path, path, fs.info(inner), inner.rpartition("/")[2])

    def walk(self, folder: str) -> Iterator[Entry]:
        fs, root = filesystem(folder)
        with remote_errors():
            for info in _walk(fs, root):
                path = info["name"]
                if has_mesh_name(path):
                    below = path.removeprefix(root).lstrip("/")
                    yield _file(folder, _url_of(fs, folder, path), info, below)

    def split_glob(self, path: str) -> tuple[str, str]:
        protocol, _, rest = path.partition("://")
        inner, chain, outer = rest.partition("::")
        folder, pattern = split_glob(inner)
        return f"{protocol}://{folder.removeprefix('.')}{chain}{outer}", pattern


REMOTE = RemoteSource()


def _walk(fs: Any, root: str) -> Iterator[dict[str, Any]]:
    """What fsspec knows of each file under a folder, sorted by path, listed folder by folder."""
    levels = [_listed(fs, root)]
    while levels:
        for info in levels[-1]:
            if info["type"] == "directory":
                levels.append(_listed(fs, info["name"]))
                break
            yield info
        else:
            levels.pop()


def _listed(fs: Any, folder: str) -> Iterator[dict[str, Any]]:
    found = fs.ls(folder, detail=True)
    fs.invalidate_cache(folder)  # which would grow with every folder
    marker = folder.rstrip("/")  # an object store may have an object in the place of a folder
    within = (info for info in found if info["name"].rstrip("/") != marker)
    return iter(sorted(within, key=lambda info: info["name"].rstrip("/")))


def _file(url: str, name: str, info: dict[str, Any], below: str) -> RemoteFile:
    return RemoteFile(url, info["name"], name, below, info["size"])


def _url_of(fs: Any, url: str, path: str) -> str:
    """The URL of a file that was found by another's, within the same archive if it is one."""
    _, chain, outer = url.partition("::")
    return f"{fs.unstrip_protocol(path)}{chain}{outer}"
