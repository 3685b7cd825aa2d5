"""All files over a Ray cluster. Importing it needs ray, of the extra `ray`.

Ray Data schedules, holds back what comes too fast, and does again what a lost node had in hand.
Entries travel, not files: whoever classifies one reads it, and it comes back as its outcome.
"""

import logging
import os
import socket
from collections.abc import Iterable, Iterator
from itertools import islice
from typing import Any, Self

# Read as Ray is imported: it neither phones home nor writes where others' output goes.
os.environ["RAY_USAGE_STATS_ENABLED"] = "0"
os.environ.setdefault("RAY_BACKEND_LOG_LEVEL", "fatal")

import ray
import ray.data
from ray.data.block import Block
from ray.exceptions import RayError

from meshconv3d.service.batch.classifying import DoneAs, Options, Outcome
from meshconv3d.service.batch.engines import EngineFailed
from meshconv3d.service.batch.entries import Entry
from meshconv3d.service.batch.local import LocalFile
from meshconv3d.service.batch.ray_actor import OneWorker, packed, unpacked
from meshconv3d.service.batch.shared import SharedFile
from meshconv3d.service.workers import Setup

# Entries that an actor takes at a time, and that are done again if its node is lost.
BLOCK = 32
# Blocks that it has in hand: while one waits for its last file, another is read.
IN_HAND = 2
# Entries that are listed before the first is classified. Ray must know all its input at once: for
# more, its actors start anew, which takes seconds.
AT_ONCE = 200_000
# Actors that may die one after the other as they start, which is put down to nodes that are lost
# without Ray's knowing it yet.
STARTS = 10
# How long a cluster may take to answer at all.
ANSWER_SECONDS = 10.0


class Ray:
    """In the actors of a cluster, each with one worker process and one CPU; see `OneWorker`."""

    def __init__(
        self, setup: Setup, workers: int | None, ordered: bool, address: str | None
    ) -> None:
        """Connect to a cluster, or start one on this machine.

        workers: as many actors; None for as many as the cluster has, or makes, room for. address:
        of a cluster; None for that of RAY_ADDRESS, or one that ends with the engine. Raises
        EngineFailed.
        """
        self._setup = setup
        self._workers = workers
        _connect(address, workers)
        _log_to_files_alone()
        context = ray.data.DataContext.get_current()
        context.enable_progress_bars = False
        context.execution_options.preserve_order = ordered
        context.max_consecutive_actor_init_deaths = STARTS

    def outcomes(
        self, entries: Iterable[Entry], options: Options, done_as: DoneAs
    ) -> Iterator[Outcome]:
        """See `Engine`. Raises EngineFailed."""
        blocks = _blocks(entries, done_as)
        while listed := list(islice(blocks, AT_ONCE // BLOCK)):
            classified = ray.data.from_blocks(listed).map_batches(
                OneWorker,
                fn_constructor_args=(self._setup, options),
                batch_size=None,
                batch_format="pyarrow",
                compute=self._pool(),
                num_cpus=1,
            )
            try:
                for block in classified.iter_batches(batch_size=None, batch_format="pyarrow"):
                    yield from unpacked(block)
            except RayError as error:
                raise EngineFailed(f"Ray gave up: {_said(error)}") from None

    def _pool(self) -> ray.data.ActorPoolStrategy:
        several: dict[str, Any] = {
            "max_concurrent_calls_per_actor": IN_HAND,
            "enable_true_multi_threading": True,
        }
        if self._workers is not None:
            return ray.data.ActorPoolStrategy(size=self._workers, **several)
        cpus = max(1, int(ray.cluster_resources().get("CPU", 1)))
        return ray.data.ActorPoolStrategy(min_size=1, initial_size=cpus, **several)

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        ray.shutdown()


def _connect(address: str | None, workers: int | None) -> None:
    given = address or os.environ.get("RAY_ADDRESS")
    if given and given != "auto":
        _check_answers(given)
    own = {} if given else {"num_cpus": workers, "include_dashboard": False}
    try:
        ray.init(given or "local", log_to_driver=False, logging_level=logging.CRITICAL, **own)
    except (ConnectionError, RuntimeError, ValueError, RayError) as error:
        where = f"the Ray cluster at {given} cannot be used" if given else "Ray does not start"
        raise EngineFailed(f"{where}: {_said(error)}") from None


def _check_answers(address: str) -> None:
    """Ray itself would try for minutes."""
    host, _, port = address.rpartition(":")
    if "/" in address or not port.isdigit():
        raise EngineFailed(
            f"{address} is no address of a Ray cluster: give HOST:PORT, or auto on one of its "
            "machines"
        )
    try:
        socket.create_connection((host, int(port)), ANSWER_SECONDS).close()
    except OSError as error:
        raise EngineFailed(f"no Ray cluster answers at {address}: {error.strerror}") from None


def _log_to_files_alone() -> None:
    """Ray keeps a log of each session; standard error is for what a person must know."""
    log = logging.getLogger("ray.data")
    log.handlers = [handler for handler in log.handlers if handler.name != "console"]


def _blocks(entries: Iterable[Entry], done_as: DoneAs) -> Iterator[Block]:
    """Entries as they travel."""
    rest = iter(entries)
    while some := list(islice(rest, BLOCK)):
        yield packed((_travelling(entry), done_as(entry.name)) for entry in some)


def _travelling(entry: Entry) -> Entry:
    return SharedFile.of(entry) if isinstance(entry, LocalFile) else entry


def _said(error: Exception) -> str:
    """The last lines of what Ray says, which are what went wrong; tracebacks come before them."""
    return " ".join(line.strip() for line in str(error).strip().splitlines()[-2:])
