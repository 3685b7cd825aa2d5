"""Where records are kept as they come, in JSON Lines: nothing that was kept is lost, however the
process ends."""

import fcntl
import os
import shutil
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Protocol

from meshconv3d.service.batch.remote import filesystem, remote_errors

# Object stores cannot append: lines go there in parts, of so many or after so many seconds.
PART_LINES = 1000
PART_SECONDS = 10.0


@contextmanager
def errors_naming(path: str | Path) -> Iterator[None]:
    """Within it, an OSError that names no file, as of a full disk, names this one."""
    try:
        yield
    except OSError as error:
        error.filename = error.filename or str(path)
        raise


class InUse(OSError):
    """Another process writes the same journal."""


class Journal(Protocol):
    """Lines that are added one by one, and found again after any end of the process."""

    def recover(self, keep: Callable[[bytes], bool]) -> None:
        """Drop the lines that are not to be kept; the last one may have been cut off. What `keep`
        raises leaves a local journal as it was."""
        ...

    def __iter__(self) -> Iterator[bytes]:
        """The lines that were recovered."""
        ...

    def add(self, line: bytes) -> None:
        """Add a line, with its end. Raises OSError."""
        ...

    def close(self) -> None: ...


class LocalJournal:
    """One file. A line is with the system as soon as it was added."""

    def __init__(self, path: Path) -> None:
        """Create it, or go on with it. Raises OSError, InUse."""
        path.parent.mkdir(parents=True, exist_ok=True)
        self._path = path
        self._file = open(path, "ab")  # noqa: SIM115 (open until closed)
        _lock(self._file.fileno(), path)

    def recover(self, keep: Callable[[bytes], bool]) -> None:
        """See `Journal`."""
        path = self._path.resolve()  # a link stays one
        fresh = path.with_name(path.name + ".new")
        kept = open(fresh, "wb")  # noqa: SIM115
        try:
            _lock(kept.fileno(), fresh)
            for line in self:
                if keep(line):
                    kept.write(line)
            kept.flush()
            shutil.copymode(path, fresh)
            os.fsync(kept.fileno())
            os.replace(fresh, path)
        except BaseException:
            kept.close()
            fresh.unlink()
            raise
        self._file.close()
        self._file = kept

    def __iter__(self) -> Iterator[bytes]:
        with self._path.open("rb") as file:
            yield from file

    def add(self, line: bytes) -> None:
        """See `Journal`."""
        with errors_naming(self._path):
            self._file.write(line)
            self._file.flush()

    def close(self) -> None:
        """Hand all to the disk."""
        with errors_naming(self._path):
            os.fsync(self._file.fileno())
            self._file.close()


class RemoteJournal:
    """A folder behind a URL, of parts that are written at once. A process that is killed loses
    the part that it was gathering, whose files are then done again."""

    def __init__(self, url: str) -> None:
        """Create it, or go on with it. Raises OSError."""
        self._fs, self._folder = filesystem(url)
        self._gathered: list[bytes] = []
        self._since = time.monotonic()
        self._parts = self._found()
        self._next = _number(self._parts[-1]) + 1 if self._parts else 0

    def _found(self) -> list[str]:
        with remote_errors():
            self._fs.invalidate_cache()
            if not self._fs.exists(self._folder):
                return []
            found = self._fs.ls(self._folder, detail=False)
        return sorted(path for path in found if path.endswith(".jsonl"))

    def recover(self, keep: Callable[[bytes], bool]) -> None:
        """See `Journal`. Parts are whole, or not there."""
        for part in self._parts:
            lines = self._lines(part)
            kept = [line for line in lines if keep(line)]
            if len(kept) < len(lines):
                self._write(part, kept)

    def __iter__(self) -> Iterator[bytes]:
        for part in self._parts:
            yield from self._lines(part)

    def _lines(self, part: str) -> list[bytes]:
        with remote_errors():
            return self._fs.cat_file(part).splitlines(keepends=True)

    def add(self, line: bytes) -> None:
        """See `Journal`."""
        self._gathered.append(line)
        late = time.monotonic() - self._since > PART_SECONDS
        if late or len(self._gathered) >= PART_LINES:
            self._end_part()

    def _end_part(self) -> None:
        if self._gathered:
            self._write(f"{self._folder}/{self._next:08}.jsonl", self._gathered)
            self._next += 1
        self._gathered = []
        self._since = time.monotonic()

    def _write(self, part: str, lines: list[bytes]) -> None:
        with remote_errors():
            self._fs.pipe_file(part, b"".join(lines))

    def close(self) -> None:
        """Write what is gathered."""
        self._end_part()


def _number(part: str) -> int:
    return int(part.rpartition("/")[2].removesuffix(".jsonl"))


def _lock(file: int, path: Path) -> None:
    try:
        fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        raise InUse(
            f"another process writes {path}: wait until it ends, or name another output"
        ) from None
