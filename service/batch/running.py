"""Files to results: each is read, hashed and classified, in this process or in worker processes;
in those of several machines, see `ray_engine`.

An executor knows neither where files come from nor where results go.
"""

import hashlib
import json
import logging
import threading
from collections import Counter, deque
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping
from concurrent.futures import Future, ThreadPoolExecutor
from contextlib import contextmanager
from dataclasses import asdict, dataclass, field
from typing import Self, TypeVar

import numpy as np
from numpy.typing import NDArray

from meshconv3d.model.errors import MeshError, UnusableMesh
from meshconv3d.model.loading import Limits
from meshconv3d.service.batch.files import File
from meshconv3d.service.prediction import Failure, Prediction, Result
from meshconv3d.service.workers import DeadlineExceeded, Task, TaskFailed, WorkerPool

log = logging.getLogger(__name__)

# Files that are read or wait for each worker, so that it never waits for one: the way to an
# object store takes many times what classifying takes. And how many bytes of them are held.
HELD_FOR_EACH = 16
HELD_BYTES = 512 * 2**20

# Files that have begun, or wait to, and whose results were not given yet. One that takes its whole
# deadline holds back the results of this many after it.
AHEAD = 1024

Item = TypeVar("Item")
T = TypeVar("T")

# Raises MeshError, DeadlineExceeded or TaskFailed.
Classify = Callable[[Task], Prediction]
# SHA-256 of the contents with which the next file of this name is already done. Called once for
# each file, before it is read.
DoneAs = Callable[[str], Collection[str]]


class ExecutorFailed(OSError):
    """Error of an executor that cannot go on. The results that it gave stay valid."""


@dataclass(frozen=True)
class Options:
    """Options of all files. model: name of the opened model. bytes: larger files are not read."""

    model: str
    bytes: int


@dataclass(frozen=True)
class FileResult:
    """Result of one file. sha256: of its content and its pieces; None if it was not read."""

    file: File
    result: Result
    sha256: str | None

    @property
    def fault(self) -> str | None:
        """Error code; None if the file was classified."""
        return self.result.fault if isinstance(self.result, Failure) else None

    @property
    def picture(self) -> bytes | None:
        """PNG of the mesh, where pictures are drawn."""
        return self.result.picture if isinstance(self.result, Prediction) else None

    @property
    def embedding(self) -> NDArray[np.float32] | None:
        """Embedding of the mesh, if it was classified."""
        return self.result.embedding if isinstance(self.result, Prediction) else None


@dataclass
class Tally:
    """Counts. classified: with a prediction. refused: by fault. earlier: those of both that an
    earlier run has left."""

    classified: int = 0
    refused: Counter[str] = field(default_factory=Counter)
    earlier: int = 0

    def add(self, fault: str | None) -> None:
        """Count one file. fault: error code; None if it was classified."""
        if fault is None:
            self.classified += 1
        else:
            self.refused[fault] += 1

    @property
    def files(self) -> int:
        """Number of all files."""
        return self.classified + self.refused.total()

    def reasons(self) -> str:
        """Error codes with their counts, most frequent first: "no-faces 2, deadline 1"."""
        return ", ".join(f"{fault} {count}" for fault, count in self.refused.most_common())


def run_id(model_sha256: str, top: int | None, limits: Limits, embedded: bool = False) -> str:
    """Hash of everything that a record depends on beside the file: 16 hexadecimal digits."""
    parts = {"model": model_sha256, "top": top, "limits": asdict(limits)}
    if embedded:
        parts["embedded"] = True
    return hashlib.sha256(json.dumps(parts, sort_keys=True).encode()).hexdigest()[:16]


class Executor:
    """Turns files into results. It reads ahead within bounds on files and bytes."""

    def results(self, files: Iterable[File], done_as: DoneAs) -> Iterator[FileResult]:
        """Result of each file that is not done, in order. Raises ExecutorFailed."""
        raise NotImplementedError

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        """Stop threads and processes."""


class SerialExecutor(Executor):
    """Classifies in this process, for a few files: worker processes take seconds to start. A file
    that crashes its reader ends this process."""

    def __init__(self, classify: Classify, options: Options) -> None:
        self._classify = classify
        self._options = options

    def results(self, files: Iterable[File], done_as: DoneAs) -> Iterator[FileResult]:
        for file in files:
            result = classify_file(file, self._options, self._classify, done_as(file.name))
            if result is not None:
                yield result


class PoolExecutor(Executor):
    """Classifies in a pool that has started, and stops it at the end.

    A thread reads each file and waits for its result. The number of threads, and a budget of bytes,
    bound what is held.
    """

    def __init__(self, pool: WorkerPool, workers: int, options: Options) -> None:
        self._pool = pool
        self._options = options
        self._threads = ThreadPoolExecutor(workers * HELD_FOR_EACH, "batch")
        self._budget = Budget(HELD_BYTES)

    def results(self, files: Iterable[File], done_as: DoneAs) -> Iterator[FileResult]:
        def begin(file: File) -> Future[FileResult | None]:
            return self._threads.submit(self._result, file, done_as(file.name))

        return filter(None, in_order(begin, files))

    def _result(self, file: File, done: Collection[str]) -> FileResult | None:
        with self._budget.held(min(file.size(), self._options.bytes)):
            return classify_file(file, self._options, self._classify, done)

    def _classify(self, task: Task) -> Prediction:
        return self._pool.submit(task).result()

    def __exit__(self, *_: object) -> None:
        self._threads.shutdown(wait=False, cancel_futures=True)
        self._pool.close()


def classify_file(
    file: File, options: Options, classify: Classify, done: Collection[str]
) -> FileResult | None:
    """Result of one file, of any content; None for one that is done, see `DoneAs`."""
    sha256 = None
    try:
        _check_size(file.size(), options.bytes)
        content = file.read()
        pieces = file.pieces(content)
        sha256 = _hash(content, pieces)
        if sha256 in done:
            return None
        result: Result = classify(
            Task(options.model, content, file.name, file.declared, pieces=pieces)
        )
    except (MeshError, OSError) as error:
        result = Failure.of(error)
    except MemoryError:
        message = "classifying it takes more memory than there is; simplify the mesh or split it up"
        result = Failure("too-much-memory", message)
    except DeadlineExceeded:
        message = "classifying it took longer than the deadline; simplify the mesh, or allow more"
        result = Failure("deadline", message)
    except TaskFailed as error:
        log.error("one mesh failed: %s", error)
        message = "classifying it failed for an unknown reason; report it, with the file"
        result = Failure("internal", message)
    return FileResult(file, result, sha256)


def _hash(content: bytes, pieces: Mapping[str, bytes]) -> str:
    """SHA-256 of a file and its pieces, in hexadecimal digits."""
    digest = hashlib.sha256(content)
    for name in sorted(pieces):
        digest.update(hashlib.sha256(name.encode()).digest())
        digest.update(hashlib.sha256(pieces[name]).digest())
    return digest.hexdigest()


def _check_size(size: int, most: int) -> None:
    if size > most:
        raise UnusableMesh(
            "too-much-memory",
            f"the file has {size} bytes, more than the {most} bytes of memory that one mesh is "
            "allowed; simplify the mesh or split it up",
        )


def in_order(
    begin: Callable[[Item], Future[T]], items: Iterable[Item], ahead: int = AHEAD
) -> Iterator[T]:
    """Results of concurrent work in the order of the items, with at most `ahead` items begun."""
    begun: deque[Future[T]] = deque()
    for item in items:
        begun.append(begin(item))
        while begun and (begun[0].done() or len(begun) >= ahead):
            yield begun.popleft().result()
    while begun:
        yield begun.popleft().result()


class Budget:
    """Bytes that all threads may hold together. A thread waits until its bytes fit; more than the
    whole budget fit alone."""

    def __init__(self, most: int) -> None:
        self._most = most
        self._free = most
        self._changed = threading.Condition()

    @contextmanager
    def held(self, size: int) -> Iterator[None]:
        """Hold bytes, once they fit."""
        size = min(size, self._most)
        with self._changed:
            self._changed.wait_for(lambda: self._free >= size)
            self._free -= size
        try:
            yield
        finally:
            with self._changed:
                self._free += size
                self._changed.notify_all()
