"""Workers that are kept alive and warm, and handed meshes one by one, in order."""

from concurrent.futures import Future
from typing import Any

from export.metadata import ModelFileError
from service.workers.jobs import Job, Jobs
from service.workers.seat import Seat
from service.workers.tasks import Record, Setup, Work

# How long a pool that is stopped as it starts waits for what its workers are just being told: they
# would complain of the rest. In seconds.
START_SECONDS = 5.0


class WorkerPool:
    """Worker processes over one queue. Work that one of them loses is that of its own file.

    >>> pool = WorkerPool(Setup([ModelFile.read("shrec11")], Limits(), 2**31, 30), workers=2)
    >>> pool.start()
    >>> pool.submit(Work("shrec11", content, None, "obj"), time.monotonic() + 30).result().content
    """

    def __init__(self, setup: Setup, workers: int) -> None:
        self._jobs = Jobs()
        self._seats = [Seat(setup, self._jobs) for _ in range(workers)]
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
        job = Job(work, expires)
        self._jobs.put(job)
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
        self._jobs.close()
        for seat in self._seats:
            seat.close()
        for seat in self._seats:
            seat.wait_while_starting(START_SECONDS)


def _by_name(models: list[dict[str, Any]]) -> dict[str, dict[str, Any]]:
    by_name = {model["name"]: model for model in models}
    if len(by_name) < len(models):
        names = ", ".join(model["name"] for model in models)
        raise ModelFileError(f"models are told apart by their names, but these are: {names}")
    return by_name
