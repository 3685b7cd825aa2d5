"""The file that records go to: kept in a journal as they come, and never done twice."""

import json
from collections.abc import Callable, Collection

from meshconv3d.service.batch.classifying import Outcome
from meshconv3d.service.batch.resuming import Done, fault_of, is_settled, stamped
from meshconv3d.service.batch.summary import Tally
from meshconv3d.service.batch.targets import NotWritten, Target

# How the line of a record begins.
RECORD_START = b'{"file":'


class Output:
    """An output that is written. tally: what earlier runs have left, and what is added."""

    def __init__(
        self, target: Target, run: str, earlier: Callable[[bytes], None] = lambda record: None
    ) -> None:
        """Create it, or go on with it. run: see `run_id`. earlier: told of each record that is
        there already.

        Raises OSError, and NotWritten where what is there is of another run.
        """
        self._target = target
        self._run = run
        self._journal = target.open_journal()
        self._journal.recover(lambda line: _is_kept(line, run, target.path))
        self._done = Done()
        self.tally = Tally()
        self._table = None if target.is_own_journal else target.table(target.open())
        for line in self._journal:
            record = json.loads(line)
            self._done.add(record["file"], record["sha256"])
            self.tally.add(fault_of(record))
            self._add_to_table(line)
            earlier(line)
        self.tally.earlier = self.tally.files

    def done_as(self, name: str) -> Collection[str]:
        """See `DoneAs`."""
        return self._done.take(name)

    def add(self, outcome: Outcome) -> None:
        """Keep a record. Raises OSError."""
        line = stamped(outcome, self._run)
        self._journal.add(line)
        self._add_to_table(line)
        self.tally.add(outcome.fault)

    def close(self) -> None:
        """Finish all files. Raises OSError."""
        self._journal.close()
        if self._table:
            with self._target.errors():
                self._table.close()
            self._target.publish()

    def _add_to_table(self, line: bytes) -> None:
        if self._table:
            with self._target.errors():
                self._table.add(line)


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
