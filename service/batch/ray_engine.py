"""Files to results over a Ray cluster. Importing it needs ray, of the extra `ray`.

Ray Data schedules the work, bounds the queues, and repeats the work of a lost node. Paths and URLs
are sent, not bytes: the actor that classifies a file reads it.
"""

import logging
import os
import pickle
import socket
from collections.abc import Iterable, Iterator
from itertools import islice
from typing import Any

# Read when Ray is imported: no telemetry, and no output on the terminal.
os.environ["RAY_USAGE_STATS_ENABLED"] = "0"
os.environ.setdefault("RAY_BACKEND_LOG_LEVEL", "fatal")

import ray
import ray.data
from ray.data.block import Block
from ray.exceptions import RayError

from meshconv3d.service.batch.files import File
from meshconv3d.service.batch.running import (
    DoneAs,
    Executor,
    ExecutorFailed,
    FileResult,
    Options,
    PoolExecutor,
)
from meshconv3d.service.workers import Setup, WorkerPool

# Files that an actor takes at a time, and that are done again if its node is lost.
BLOCK = 32
# Blocks of an actor at a time: while one waits for its last file, another is read.
IN_HAND = 2
# Files of one Ray job, which are listed before the first is classified. Each job starts its actors,
# which takes seconds.
AT_ONCE = 200_000
# Actors that may die one after the other at their start: nodes may be lost without Ray knowing it.
STARTS = 10
# Time for a cluster to accept a connection.
ANSWER_SECONDS = 10.0
# The address that stands for a cluster on this machine that ends with the executor.
LOCAL = "local"


class RayExecutor(Executor):
    """Classifies in the actors of a cluster, each with one worker process and one CPU."""

    def __init__(self, setup: Setup, workers: int | None, address: str, options: Options) -> None:
        """Connect to a cluster, or start one on this machine.

        workers: as many actors; None for as many as the cluster has, or makes, room for. address:
        LOCAL, HOST:PORT, or auto for that of RAY_ADDRESS or of this machine. Raises
        ExecutorFailed.
        """
        self._setup = setup
        self._workers = workers
        self._options = options
        _connect(address, workers)
        _log_to_files_alone()
        context = ray.data.DataContext.get_current()
        context.enable_progress_bars = False
        context.execution_options.preserve_order = True
        context.max_consecutive_actor_init_deaths = STARTS

    def results(self, files: Iterable[File], done_as: DoneAs) -> Iterator[FileResult]:
        blocks = _blocks(files, done_as)
        while listed := list(islice(blocks, AT_ONCE // BLOCK)):
            classified = ray.data.from_blocks(listed).map_batches(
                Actor,
                fn_constructor_args=(self._setup, self._options),
                batch_size=None,
                batch_format="pyarrow",
                compute=self._pool(),
                num_cpus=1,
            )
            try:
                for block in classified.iter_batches(batch_size=None, batch_format="pyarrow"):
                    yield from _unpacked(block)
            except RayError as error:
                raise ExecutorFailed(f"Ray gave up: {_said(error)}") from None

    def _pool(self) -> ray.data.ActorPoolStrategy:
        several: dict[str, Any] = {
            "max_concurrent_calls_per_actor": IN_HAND,
            "enable_true_multi_threading": True,
        }
        if self._workers is not None:
            return ray.data.ActorPoolStrategy(size=self._workers, **several)
        cpus = max(1, int(ray.cluster_resources().get("CPU", 1)))
        return ray.data.ActorPoolStrategy(min_size=1, initial_size=cpus, **several)

    def __exit__(self, *_: object) -> None:
        ray.shutdown()


class Actor:
    """Turns blocks of files into blocks of results, on a node of the cluster.

    It reads the files, and its one worker process classifies them: a file that crashes the process
    costs its own record alone. Several blocks may be in work at a time.
    """

    def __init__(self, setup: Setup, options: Options) -> None:
        """Raises ModelFileError, SelfTestError or NotStarted."""
        pool = WorkerPool(setup, 1)
        pool.start()
        self._executor = PoolExecutor(pool, 1, options)

    def __call__(self, block: Block) -> Block:
        """Results of the files that are not done. block: pairs of a file and its `DoneAs`."""
        pairs = _unpacked(block)
        done = iter([contents for _, contents in pairs])
        files = [file for file, _ in pairs]
        return _packed(self._executor.results(files, lambda _: next(done)))


def _packed(values: Iterable[Any]) -> Block:
    import pyarrow as pa  # which comes with ray

    return pa.table({"value": pa.array(map(pickle.dumps, values), pa.binary())})


def _unpacked(block: Block) -> list[Any]:
    return [pickle.loads(value) for value in block["value"].to_pylist()]


def _blocks(files: Iterable[File], done_as: DoneAs) -> Iterator[Block]:
    rest = iter(files)
    while some := list(islice(rest, BLOCK)):
        yield _packed((file.shared(), done_as(file.name)) for file in some)


def _connect(address: str, workers: int | None) -> None:
    if address == "auto":
        address = os.environ.get("RAY_ADDRESS", address)
    if address not in ("auto", LOCAL):
        _check_answers(address)
    own = {"num_cpus": workers, "include_dashboard": False} if address == LOCAL else {}
    try:
        ray.init(address, log_to_driver=False, logging_level=logging.CRITICAL, **own)
    except (ConnectionError, RuntimeError, ValueError, RayError) as error:
        where = "Ray does not start"
        if address != LOCAL:
            where = f"the Ray cluster at {address} cannot be used"
        raise ExecutorFailed(f"{where}: {_said(error)}") from None


def _check_answers(address: str) -> None:
    """Raise ExecutorFailed if nothing accepts a connection: Ray would retry for minutes."""
    host, _, port = address.rpartition(":")
    if "/" in address or not port.isdigit():
        raise ExecutorFailed(
            f"{address} is no address of a Ray cluster: give HOST:PORT, auto on one of its "
            f"machines, or {LOCAL} to start one on this machine"
        )
    try:
        socket.create_connection((host, int(port)), ANSWER_SECONDS).close()
    except OSError as error:
        raise ExecutorFailed(f"no Ray cluster answers at {address}: {error.strerror}") from None


def _log_to_files_alone() -> None:
    """Keep Ray Data's messages in its log files, off standard error."""
    log = logging.getLogger("ray.data")
    log.handlers = [handler for handler in log.handlers if handler.name != "console"]


def _said(error: Exception) -> str:
    """Last lines of an error of Ray, which tell the reason; tracebacks come before them."""
    return " ".join(line.strip() for line in str(error).strip().splitlines()[-2:])
