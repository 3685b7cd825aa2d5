"""Journals: every record is kept in one at once, so that a run can go on however it ended.

A journal is JSON Lines: of this machine one file, behind a URL a folder of parts.
"""

import base64
import errno
import fcntl
import hashlib
import os
import sqlite3
import stat
import time
from collections.abc import Callable, Collection, Iterator, Mapping
from pathlib import Path
from typing import BinaryIO, TypeAlias

from pydantic import TypeAdapter

from meshconv3d.model.files import errors_naming, replacing
from meshconv3d.service.batch.files import filesystem, remote_errors
from meshconv3d.service.records import Answer, EmbeddedAnswer, Refusal

# Object stores cannot append: parts are written after so many lines or seconds.
PART_LINES = 1000
PART_SECONDS = 10.0

# Errors that may not occur again: they depend on the machine as well as on the file.
PASSING = frozenset({"deadline", "internal", "too-much-memory", "worker-crashed"})

# First bytes of the line of a record, and its maximum length.
RECORD_START = b'{"file":'
LONGEST_LINE = 64 * 2**20


class AnswerEntry(Answer):
    """An answer in an output. sha256: of the file's content; run: see `run_id`."""

    file: str
    sha256: str
    run: str


class EmbeddedEntry(EmbeddedAnswer, AnswerEntry):
    """An answer in a library. picture: base64 of a PNG, where pictures are drawn."""

    picture: str | None


class RefusalEntry(Refusal):
    """A refusal in an output. sha256: None if the file could not be read."""

    file: str
    sha256: str | None
    run: str


Entry: TypeAlias = EmbeddedEntry | AnswerEntry | RefusalEntry
_ENTRY: TypeAdapter[Entry] = TypeAdapter(Entry)


class NotWritten(ValueError):
    """Error of an output that cannot be written as requested; the message says what to do."""


def entry(
    record: Answer | Refusal, sha256: str | None, run: str, picture: bytes | None = None
) -> Entry:
    """The entry of a record. picture: for a library. Raises ValueError for an answer without a
    hash."""
    added: dict[str, object] = {"sha256": sha256, "run": run}
    if isinstance(record, EmbeddedAnswer):
        added["picture"] = picture and base64.b64encode(picture).decode()
    return as_entry(dict(record) | added)


def as_entry(values: Mapping[str, object]) -> Entry:
    """The entry of these values. Raises ValueError."""
    return _ENTRY.validate_python(values)


def is_settled(found: Entry) -> bool:
    """Whether another attempt would give the same record."""
    return found.sha256 is not None and fault_of(found) not in PASSING


def fault_of(record: Answer | Refusal) -> str | None:
    """Error code of a record; None for an answer."""
    return record.error.fault if isinstance(record, Refusal) else None


def parse_line(line: bytes) -> Entry:
    """The entry on a line of a journal. Raises ValueError."""
    return _ENTRY.validate_json(line)


def kept_entry(line: bytes, number: int, run: str, path: str) -> Entry | None:
    """The entry on a line of a journal, if a resumed run keeps it. number, path: of the line.

    Raises NotWritten for a line that is damaged, or was written by another run or program.
    """
    content = line.rstrip(b"\0")  # a file may end with these after a loss of power
    whole = line.endswith(b"\n") or len(line) == LONGEST_LINE
    if not whole and content.startswith(RECORD_START[: len(content)]):
        return None  # the process was killed while writing it
    if line.isspace():
        return None
    try:
        found = parse_line(line)
    except ValueError:
        raise NotWritten(
            f"{path}: line {number} is no record of this command, or damaged; take that line out, "
            "or name another file"
        ) from None
    check_run(found, run, path)
    return found if is_settled(found) else None


def check_run(found: Entry, run: str, path: str) -> None:
    """Raises NotWritten for an entry of another run."""
    if found.run != run:
        raise NotWritten(
            f"{path} was written by another model, or with another --top or other limits: resume "
            "with the same, or name another file"
        )


class LocalJournal:
    """One file of lines. Each line is flushed to the system as it is added, so that it survives any
    end of the process."""

    def __init__(self, path: Path) -> None:
        """Create or resume it. Raises OSError, also if another process writes it."""
        self._path = path
        self._file = _open_to_append(path)
        _lock(self._file, path)

    def recover(self, keep: Callable[[bytes], bool]) -> None:
        """Remove the lines that `keep` rejects. If it raises, nothing is removed."""
        with replacing(self._path) as fresh:
            fcntl.flock(fresh, fcntl.LOCK_EX)
            fresh.writelines(filter(keep, self))
            kept = os.dup(fresh.fileno())  # with its lock
        self._file.close()
        self._file = open(kept, "r+b")  # noqa: SIM115 (open until closed)

    def __iter__(self) -> Iterator[bytes]:
        """All lines, in pieces of LONGEST_LINE bytes at most; the last may be cut off."""
        with self._path.open("rb") as file:
            yield from iter(lambda: file.readline(LONGEST_LINE), b"")

    def add(self, line: bytes) -> None:
        """Add a line, with its end. Raises OSError."""
        with errors_naming(self._path):
            self._file.write(line)
            self._file.flush()

    def close(self) -> None:
        """Write what is still held. Raises OSError."""
        with errors_naming(self._path), self._file:
            os.fsync(self._file.fileno())

    def remove(self) -> None:
        """Remove it, once it is closed. Raises OSError."""
        self._path.unlink()


class RemoteJournal:
    """A folder behind a URL, of parts that are written whole; its methods are those of
    `LocalJournal`.

    To append as fsspec offers it would lose records: gcsfs replaces the file instead. A process
    that is killed loses the part that it was gathering, whose files are then classified again.
    """

    def __init__(self, url: str) -> None:
        self._fs, self._folder = filesystem(url)
        self._gathered: list[bytes] = []
        self._since = time.monotonic()
        with remote_errors():
            self._fs.invalidate_cache()
            self._parts = sorted(self._fs.glob(f"{self._folder}/*.jsonl"))
        last = self._parts[-1].rpartition("/")[2] if self._parts else ""
        self._next = int(last.removesuffix(".jsonl") or -1) + 1

    def recover(self, keep: Callable[[bytes], bool]) -> None:
        for part in self._parts:
            lines = self._lines(part)
            kept = list(filter(keep, lines))
            if len(kept) < len(lines):
                self._write(part, kept)

    def __iter__(self) -> Iterator[bytes]:
        for part in self._parts:
            yield from self._lines(part)

    def _lines(self, part: str) -> list[bytes]:
        with remote_errors():
            return self._fs.cat_file(part).splitlines(keepends=True)

    def _write(self, part: str, lines: list[bytes]) -> None:
        with remote_errors():
            self._fs.pipe_file(part, b"".join(lines))

    def add(self, line: bytes) -> None:
        self._gathered.append(line)
        late = time.monotonic() - self._since > PART_SECONDS
        if late or len(self._gathered) >= PART_LINES:
            self.close()

    def close(self) -> None:
        if self._gathered:
            part = f"{self._folder}/{self._next:08}.jsonl"
            self._write(part, self._gathered)
            self._parts.append(part)
            self._next += 1
        self._gathered = []
        self._since = time.monotonic()

    def remove(self) -> None:
        with remote_errors():
            self._fs.rm(self._folder, recursive=True)


def _open_to_append(path: Path) -> BinaryIO:
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


def _lock(file: BinaryIO, path: Path) -> None:
    in_use = f"another process writes {path}: wait until it ends, or name another output"
    try:
        fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        raise OSError(in_use) from None
    if not os.path.samestat(os.fstat(file.fileno()), os.lstat(path)):
        raise OSError(in_use)  # it was replaced before it was locked


class Done:
    """Files that are done, by name and content, in a database on disk."""

    def __init__(self) -> None:
        # Without a name: a temporary file, which is removed with this process.
        self._files = sqlite3.connect("", isolation_level=None)
        self._execute("PRAGMA journal_mode = OFF")
        self._execute("CREATE TABLE done (name BLOB, sha256 TEXT, UNIQUE (name, sha256))")

    def add(self, found: Entry) -> bool:
        """Note the file of an entry, unless it is there. Returns whether it was not."""
        values = _key(found.file), found.sha256
        return self._execute("INSERT OR IGNORE INTO done VALUES (?, ?)", *values).rowcount == 1

    def take(self, name: str) -> Collection[str]:
        """Contents with which the next file of this name is done, see `DoneAs`.

        Each call removes one: a file that is named twice has two records.
        """
        query = "SELECT rowid, sha256 FROM done WHERE name = ? ORDER BY rowid"
        found = self._execute(query, _key(name)).fetchall()
        if found:
            self._execute("DELETE FROM done WHERE rowid = ?", found[0][0])
        return {content for _, content in found}

    def _execute(self, statement: str, *values: object) -> sqlite3.Cursor:
        try:
            return self._files.execute(statement, values)
        except sqlite3.Error as error:
            raise OSError(errno.EIO, f"no room for a temporary database: {error}") from None


def _key(name: str) -> bytes:
    return hashlib.sha256(name.encode()).digest()[:16]
