"""What is done already, so that it is not done again."""

import json
import sqlite3
from collections.abc import Collection
from hashlib import sha256
from typing import Any

from meshconv3d.service.batch.classifying import PASSING, Outcome


def stamped(outcome: Outcome, run: str) -> bytes:
    """The line of an outcome in an output file: its record, with what tells that it is done."""
    stamp = json.dumps({"sha256": outcome.sha256, "run": run})
    # Parsing and writing the record anew would cost as much as reading the mesh.
    return outcome.record[:-1] + b"," + stamp[1:].encode() + b"\n"


def fault_of(record: dict[str, Any]) -> str | None:
    """Why a file was not classified, by its record; None if it was."""
    return record["error"]["fault"] if "error" in record else None


def is_settled(record: dict[str, Any]) -> bool:
    """Whether another attempt would give the same record."""
    return record["sha256"] is not None and fault_of(record) not in PASSING


class Done:
    """The files that are done, by name and content. On disk: memory is for what is not done."""

    def __init__(self) -> None:
        # Without a name: a database that only this process sees, and that goes with it.
        self._files = sqlite3.connect("", isolation_level=None)
        self._files.execute("PRAGMA journal_mode = OFF")
        self._files.execute("CREATE TABLE times (name BLOB PRIMARY KEY, times INTEGER)")
        self._files.execute("CREATE TABLE contents (name BLOB, sha256 TEXT, UNIQUE (name, sha256))")

    def add(self, name: str, content: str) -> None:
        """Note a file, by its name and the SHA-256 of its content."""
        key = _key(name)
        self._files.execute(
            "INSERT INTO times VALUES (?, 1) ON CONFLICT DO UPDATE SET times = times + 1", (key,)
        )
        self._files.execute("INSERT OR IGNORE INTO contents VALUES (?, ?)", (key, content))

    def take(self, name: str) -> Collection[str]:
        """The contents with which the next file of this name is done.

        Given once for each time that the name was noted: a file may have been named twice, and
        then has two records.
        """
        key = _key(name)
        taken = self._files.execute(
            "UPDATE times SET times = times - 1 WHERE name = ? AND times > 0", (key,)
        )
        if taken.rowcount == 0:
            return ()
        found = self._files.execute("SELECT sha256 FROM contents WHERE name = ?", (key,))
        return {content for (content,) in found}


def _key(name: str) -> bytes:
    return sha256(name.encode()).digest()[:16]
