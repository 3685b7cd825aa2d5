"""The file that records go to: kept in a journal as they come, and never done twice.

JSON Lines on this machine are their own journal. Any other file has one beside it, named after it
with `.journal`, from which it is made anew by each run that goes on.
"""

import json
import os
from collections.abc import Callable, Collection
from pathlib import Path
from typing import BinaryIO

from service.batch.classifying import Outcome
from service.batch.journals import Journal, LocalJournal, RemoteJournal
from service.batch.remote import filesystem, is_url, remote_errors
from service.batch.resuming import Done, fault_of, is_settled, stamped
from service.batch.summary import Tally
from service.batch.tables import Csv, Lines, Table

FORMS = ("jsonl", "csv", "parquet")
# How the line of a record begins.
RECORD_START = b'{"file":'


class NotWritten(ValueError):
    """An output cannot be written as it was asked for; the message says what to do."""


class Target:
    """Where an output goes: a path or a URL that ends with one of FORMS."""

    def __init__(self, path: str) -> None:
        """Raises NotWritten."""
        self.path = path
        self.form = path.rpartition(".")[2].lower()
        if self.form not in FORMS:
            forms = ", ".join(f".{form}" for form in FORMS)
            raise NotWritten(f"{path} does not end with a form that is written: {forms}")
        self.is_own_journal = self.form == "jsonl" and not is_url(path)
        self.journal = path if self.is_own_journal else f"{path}.journal"
        # Parquet cannot be read before its end is written.
        self._written = f"{path}.new" if self.form == "parquet" and not is_url(path) else path

    def check(self, resume: bool) -> None:
        """Raises NotWritten where there is something that would be overwritten."""
        if _exists(self.journal):
            if not resume:
                raise NotWritten(
                    f"{self.path} is there already, or was begun: go on with it by --resume, or "
                    "name another file"
                )
        elif _exists(self.path):
            raise NotWritten(
                f"{self.path} is there already, without the {self.journal} by which it could be "
                "gone on with: name another file"
            )

    def open_journal(self) -> Journal:
        """Raises OSError."""
        return (
            RemoteJournal(self.journal)
            if is_url(self.journal)
            else LocalJournal(Path(self.journal))
        )

    def table(self) -> Callable[[BinaryIO], Table]:
        """What writes its form; an extra that is missing is found out here."""
        if self.form == "parquet":
            from service.batch.parquet import Parquet

            return Parquet
        return {"csv": Csv, "jsonl": Lines}[self.form]

    def open(self) -> BinaryIO:
        """Raises OSError."""
        if not is_url(self.path):
            return open(self._written, "wb")
        fs, path = filesystem(self.path)
        with remote_errors():
            return fs.open(path, "wb")

    def publish(self) -> None:
        """What was written and closed is the output."""
        if self._written != self.path:
            os.replace(self._written, self.path)


class Output:
    """An output that is written. tally: what earlier runs have left, and what is added."""

    def __init__(self, target: Target, run: str) -> None:
        """Create it, or go on with it. run: see `run_id`.

        Raises OSError, and NotWritten where what is there is of another run.
        """
        write = None if target.is_own_journal else target.table()
        self._target = target
        self._run = run
        self._journal = target.open_journal()
        self._journal.recover(lambda line: _is_kept(line, run, target.path))
        self._done = Done()
        self.tally = Tally()
        self._table = write(target.open()) if write else None
        for line in self._journal:
            record = json.loads(line)
            self._done.add(record["file"], record["sha256"])
            self.tally.add(fault_of(record))
            if self._table:
                self._table.add(line)
        self.tally.earlier = self.tally.files

    def done_as(self, name: str) -> Collection[str]:
        """See `DoneAs`."""
        return self._done.take(name)

    def add(self, outcome: Outcome) -> None:
        """Keep a record. Raises OSError."""
        line = stamped(outcome, self._run)
        self._journal.add(line)
        if self._table:
            self._table.add(line)
        self.tally.add(outcome.fault)

    def close(self) -> None:
        """Finish all files. Raises OSError."""
        self._journal.close()
        if self._table:
            self._table.close()
            self._target.publish()


def _is_kept(line: bytes, run: str, path: str) -> bool:
    """Whether a line stays. Raises NotWritten for what another run or program has written."""
    if not line.endswith(b"\n") and line.startswith(RECORD_START[: len(line)]):
        return False  # the process was killed as it wrote it
    try:
        record = json.loads(line)
        other = record["run"] != run
    except (ValueError, TypeError, KeyError):
        raise NotWritten(
            f"{path} holds lines that are no records of this command: name another file"
        ) from None
    if other:
        raise NotWritten(
            f"{path} was written by another model, or with another --top or other limits: resume "
            "with the same, or name another file"
        )
    return is_settled(record)


def _exists(path: str) -> bool:
    if not is_url(path):
        return os.path.exists(path)
    fs, inner = filesystem(path)
    with remote_errors():
        fs.invalidate_cache()
        return fs.exists(inner)
