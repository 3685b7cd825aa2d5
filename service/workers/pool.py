"""Workers that are kept alive and warm, and handed one mesh at a time, in order."""

import dataclasses
import logging
import queue
import threading
import time
from concurrent.futures import Future
from contextlib import suppress
from typing import Any

from export.metadata import ModelFileError
from service.workers.tasks import Record, Setup, Work
from service.workers.worker import NotStarted, Worker, crashed

log = logging.getLogger(__name__)

# How often an idle worker is looked after, and how long until one that does not start is tried
# again, in seconds.
CHECK_SECONDS = 0.5
RETRY_SECONDS = 1.0


class _Job:
    """Work in the queue, until it is done or cancelled. expires: on the monotonic clock, or None:
    some time after its beginning."""

    def __init__(self, work: Work, expires: float | None) -> None:
        self.work: Work | None = work
        self.queued = time.perf_counter()
        self.expires = expires
        self.future: Future[Record] = Future()
        self.future.add_done_callback(self._forget)

    def _forget(self, _: Future[Record]) -> None:
        self.work = None  # what was cancelled may stay in the queue for long, its bytes may not


class WorkerPool:
    """Worker processes over one queue. Work that one of them loses is that of its own file.

    >>> pool = WorkerPool(Setup([ModelFile.read("shrec11")], Limits(), 2**31, 30), workers=2)
    >>> pool.start()
    >>> pool.submit(Work("shrec11", content, None, "obj"), time.monotonic() + 30).result().content
    """

    def __init__(self, setup: Setup, workers: int) -> None:
        self._jobs: queue.SimpleQueue[_Job] = queue.SimpleQueue()
        self._seats = [_Seat(setup, self._jobs) for _ in range(workers)]
        self._stopped = False
        self.models: dict[str, dict[str, Any]] = {}

    def start(self) -> None:
        """Start all workers and wait until they are warm; then `models` says what they serve.

        Raises ModelFileError or SelfTestError for a model that cannot serve, and for two of one
        name.
        """
        for seat in self._seats:
            seat.start()
        try:
            for seat in self._seats:
                self.models = _by_name(seat.warm.result())
        except BaseException:
            self.stop()
            raise

    def submit(self, work: Work, expires: float | None = None) -> Future[Record]:
        """Queue one mesh, to be classified by `expires` on the monotonic clock; with None, within
        the setup's seconds of when a worker begins with it.

        The future gives a record, with `queue` among its timings, or raises MeshError,
        DeadlineExceeded or TaskFailed. Work that waits can be cancelled, and is forgotten at once;
        what runs, runs on to its deadline: to end it costs more than to finish it.
        """
        job = _Job(work, expires)
        self._jobs.put(job)
        if self._stopped:
            self._drop_waiting()
        return job.future

    @property
    def alive(self) -> int:
        """How many workers are warm."""
        return sum(seat.alive for seat in self._seats)

    @property
    def restarts(self) -> int:
        """How many workers were replaced so far."""
        return sum(seat.restarts for seat in self._seats)

    def stop(self) -> None:
        """End all workers at once, whatever they run; work that waits is cancelled."""
        self._stopped = True
        self._drop_waiting()
        for seat in self._seats:
            seat.close()

    def _drop_waiting(self) -> None:
        with suppress(queue.Empty):
            while True:
                self._jobs.get_nowait().future.cancel()


def _by_name(models: list[dict[str, Any]]) -> dict[str, dict[str, Any]]:
    by_name = {model["name"]: model for model in models}
    if len(by_name) < len(models):
        names = ", ".join(model["name"] for model in models)
        raise ModelFileError(f"models are told apart by their names, but these are: {names}")
    return by_name


class _Seat(threading.Thread):
    """Keeps one worker: takes work from the queue, and a new worker for one that died.

    warm: what the models of the first worker say of themselves, or why it did not start.
    """

    def __init__(self, setup: Setup, jobs: "queue.SimpleQueue[_Job]") -> None:
        super().__init__(daemon=True, name="worker-seat")
        self._setup = setup
        self._jobs = jobs
        self._worker: Worker | None = None
        self.warm: Future[list[dict[str, Any]]] = Future()
        self.closing = threading.Event()
        self.restarts = 0

    @property
    def alive(self) -> bool:
        return self._worker is not None and self._worker.alive

    def close(self) -> None:
        """Take no more work, and lose what the worker has in hand."""
        self.closing.set()
        if self._worker is not None:
            self._worker.kill()

    def run(self) -> None:
        try:
            self._worker = Worker(self._setup)
        except Exception as error:
            self.warm.set_exception(error)
            return
        self.warm.set_result(self._worker.models)
        while not self.closing.is_set():
            self._take(self._worker)
            self._worker = self._living(self._worker)
        self._worker.end()

    def _take(self, worker: Worker) -> None:
        """Wait for a piece of work, and do it."""
        try:
            job = self._jobs.get(timeout=CHECK_SECONDS)
        except queue.Empty:
            return
        if not job.future.set_running_or_notify_cancel():
            return
        work, expires = job.work, job.expires
        assert work is not None
        if expires is None:
            expires = time.monotonic() + self._setup.seconds
        waited = round((time.perf_counter() - job.queued) * 1000, 3)
        try:
            record = self._classify(work, expires, worker)
        except Exception as error:
            job.future.set_exception(error)
        else:
            timings = {"queue": waited, **record.timings_ms}
            job.future.set_result(dataclasses.replace(record, timings_ms=timings))

    def _classify(self, work: Work, expires: float, worker: Worker) -> Record:
        """Give a worker that died before it began one successor; see `Worker.classify`."""
        try:
            return worker.classify(work, expires)
        except NotStarted:
            self._worker = worker = self._living(worker)
        try:
            return worker.classify(work, expires)
        except NotStarted:
            raise crashed("twice, as it was handed over") from None

    def _living(self, worker: Worker) -> Worker:
        """The worker itself, or if it died, a new one."""
        while not worker.alive and not self.closing.is_set():
            worker.end()
            try:
                worker = Worker(self._setup)
                self.restarts += 1
                log.warning("a worker ended, and another has taken its place")
            except Exception as error:
                log.error("a worker does not start, which is tried again: %s", error)
                self.closing.wait(RETRY_SECONDS)
        return worker
