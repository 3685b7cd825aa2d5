"""How all files get their outcomes: one after the other in this process, or in worker processes;
in those of several machines, see `ray_engine`.

An engine knows neither where files come from nor where outcomes go.
"""

from collections.abc import Collection, Iterable, Iterator
from concurrent.futures import Future, ThreadPoolExecutor
from typing import Protocol, Self

from meshconv3d.service.batch.budget import Budget
from meshconv3d.service.batch.classifying import Classify, DoneAs, Options, Outcome, classify_entry
from meshconv3d.service.batch.entries import Entry
from meshconv3d.service.batch.ordering import as_they_come, in_order
from meshconv3d.service.prediction import Prediction
from meshconv3d.service.workers import Task, ThreadedPool

# Files that are read or wait for each worker, so that it never waits for one: the way to an
# object store takes many times what classifying takes. And how many bytes of them are held.
HELD_FOR_EACH = 16
HELD_BYTES = 512 * 2**20


class EngineFailed(Exception):
    """An engine cannot go on; the message says why. The outcomes that it gave stand."""


class Engine(Protocol):
    """Turns entries into outcomes, within bounds on what is held, whatever comes."""

    def outcomes(
        self, entries: Iterable[Entry], options: Options, done_as: DoneAs
    ) -> Iterator[Outcome]:
        """The outcome of each file that is not done."""
        ...

    def __enter__(self) -> Self: ...

    def __exit__(self, *_: object) -> None: ...


class Here:
    """In this process, in order. For a few files: worker processes take seconds to start. A file
    that breaks its reader breaks this process."""

    def __init__(self, classify: Classify) -> None:
        self._classify = classify

    def outcomes(
        self, entries: Iterable[Entry], options: Options, done_as: DoneAs
    ) -> Iterator[Outcome]:
        """See `Engine`."""
        for entry in entries:
            outcome = classify_entry(entry, options, self._classify, done_as(entry.name))
            if outcome is not None:
                yield outcome

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        pass


class Workers:
    """In the processes of a pool that has started; it is stopped at the end.

    A thread for each file on its way reads it, and waits for its worker: so what is held is
    bounded by the number of threads, and by their bytes.
    """

    def __init__(self, pool: ThreadedPool, workers: int, ordered: bool) -> None:
        """ordered: outcomes come in the order of the entries, not as they are done."""
        self._pool = pool
        self._threads = ThreadPoolExecutor(workers * HELD_FOR_EACH, "batch")
        self._budget = Budget(HELD_BYTES)
        self._arranged = in_order if ordered else as_they_come

    def outcomes(
        self, entries: Iterable[Entry], options: Options, done_as: DoneAs
    ) -> Iterator[Outcome]:
        """See `Engine`."""

        def begin(entry: Entry) -> Future[Outcome | None]:
            return self._threads.submit(self._outcome, entry, options, done_as(entry.name))

        return filter(None, self._arranged(begin, entries))

    def _outcome(self, entry: Entry, options: Options, done: Collection[str]) -> Outcome | None:
        with self._budget.held(min(entry.size(), options.bytes)):
            return classify_entry(entry, options, self._classify, done)

    def _classify(self, task: Task) -> Prediction:
        return self._pool.submit(task).result()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self._threads.shutdown(wait=False, cancel_futures=True)
        self._pool.close()
