"""What runs on the nodes of a Ray cluster: blocks of entries in, blocks of outcomes out."""

import pickle
from collections.abc import Collection, Iterable

import pyarrow as pa

from meshconv3d.service.batch.classifying import Options, Outcome
from meshconv3d.service.batch.engines import Workers
from meshconv3d.service.batch.entries import Entry
from meshconv3d.service.workers import Setup, ThreadedPool

OUTCOMES = pa.schema(
    {
        "entry": pa.binary(),
        "record": pa.binary(),
        "sha256": pa.string(),
        "fault": pa.string(),
        "picture": pa.binary(),
    }
)


class OneWorker:
    """The engine of one machine with one worker process, which opens the models once.

    The actor reads the files and the process classifies them: one that breaks its reader costs
    its own record, as everywhere, and neither the actor nor what else it has in hand. Several
    blocks may be in hand at a time.
    """

    def __init__(self, setup: Setup, options: Options) -> None:
        """Raises ModelFileError, SelfTestError or NotStarted."""
        pool = ThreadedPool(setup, 1)
        pool.start()
        self._engine = Workers(pool, 1, ordered=True)
        self._options = options

    def __call__(self, block: pa.Table) -> pa.Table:
        """The outcomes of the entries that are not done. block: see `packed`."""
        rows = [pickle.loads(row) for row in block["entry"].to_pylist()]
        done = iter([contents for _, contents in rows])
        entries = [entry for entry, _ in rows]
        outcomes = self._engine.outcomes(entries, self._options, lambda _: next(done))
        found = [vars(one) | {"entry": pickle.dumps(one.entry)} for one in outcomes]
        return pa.Table.from_pylist(found, OUTCOMES)


def packed(entries: Iterable[tuple[Entry, Collection[str]]]) -> pa.Table:
    """A block of entries, each with the contents with which it is done."""
    rows = [pickle.dumps(entry) for entry in entries]
    return pa.table({"entry": pa.array(rows, pa.binary())})


def unpacked(block: pa.Table) -> list[Outcome]:
    """The outcomes in a block that came back."""
    return [Outcome(**row | {"entry": pickle.loads(row["entry"])}) for row in block.to_pylist()]
