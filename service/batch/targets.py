"""Where an output goes, in which form, and what must not be overwritten there.

JSON Lines on this machine are their own journal. Any other file has one beside it, named after it
with `.journal`, from which it is made anew by each run that goes on.
"""

import os
from collections.abc import Callable
from contextlib import AbstractContextManager
from pathlib import Path
from typing import BinaryIO

from meshconv3d.service.batch.journals import Journal, LocalJournal, RemoteJournal, errors_naming
from meshconv3d.service.batch.remote import filesystem, is_url, remote_errors
from meshconv3d.service.batch.tables import Csv, Lines, Table

FORMS = ("jsonl", "csv", "parquet")


class NotWritten(ValueError):
    """An output cannot be written as it was asked for; the message says what to do."""


class Target:
    """Where an output goes: a path or a URL that ends with one of FORMS."""

    def __init__(self, path: str) -> None:
        """Raises NotWritten, and ModuleNotFoundError where an extra is missing."""
        self.path = path
        self.form = path.rpartition(".")[2].lower()
        if self.form not in FORMS:
            forms = ", ".join(f".{form}" for form in FORMS)
            raise NotWritten(f"{path} does not end with a form that is written: {forms}")
        self._remote = is_url(path)
        self.is_own_journal = self.form == "jsonl" and not self._remote
        self.journal = path if self.is_own_journal else f"{path}.journal"
        self.table = _table_of(self.form)
        self._place = path if self._remote else os.path.realpath(path)  # a link stays one
        # Parquet cannot be read before its end is written.
        unread = self.form == "parquet" and not self._remote
        self._written = f"{self._place}.new" if unread else self._place

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
        if self._remote:
            return RemoteJournal(self.journal)
        return LocalJournal(Path(self.journal))

    def open(self) -> BinaryIO:
        """Raises OSError."""
        if not self._remote:
            return open(self._written, "wb")
        fs, path = filesystem(self.path)
        with remote_errors():
            return fs.open(path, "wb")

    def errors(self) -> AbstractContextManager[None]:
        """Within it, what goes wrong with the open file is an OSError that says with which."""
        return remote_errors() if self._remote else errors_naming(self.path)

    def publish(self) -> None:
        """What was written and closed is the output."""
        if self._written != self._place:
            os.replace(self._written, self._place)


def _table_of(form: str) -> Callable[[BinaryIO], Table]:
    if form == "parquet":
        from meshconv3d.service.batch.parquet import Parquet

        return Parquet
    return {"csv": Csv, "jsonl": Lines}[form]


def _exists(path: str) -> bool:
    if not is_url(path):
        return os.path.exists(path)
    fs, inner = filesystem(path)
    with remote_errors():
        fs.invalidate_cache()
        return fs.exists(inner)
