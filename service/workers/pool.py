"""Workers that are kept alive and warm, and handed meshes one by one, in order."""

import asyncio
from concurrent.futures import Future

from meshconv3d.export.metadata import ModelFileError
from meshconv3d.service.models import ModelInfo
from meshconv3d.service.workers.jobs import Job, Jobs
from meshconv3d.service.workers.seat import Seat
from meshconv3d.service.workers.tasks import Setup, Task
from meshconv3d.service.workers.worker import Worker, start_worker

# How long to wait for seats that are told of the end, in seconds.
CLOSE_SECONDS = 1.0


class WorkerPool:
    """Worker processes over one queue. Work that one of them loses is that of its own file.

    >>> pool = WorkerPool(Setup([ModelFile.read("shrec11")], Limits(), 2**31, 30), workers=2)
    >>> pool.start()
    >>> async def classify() -> Prediction:
    ...     pool.attach()
    ...     return await pool.submit(Task("shrec11", content, None, "obj")).future
    """

    def __init__(self, setup: Setup, workers: int) -> None:
        self._setup = setup
        self._workers = workers
        self._jobs = Jobs()
        self._seats: list[Seat] = []
        self._tasks: list[asyncio.Task[None]] = []
        self.models: dict[str, ModelInfo] = {}

    def start(self) -> None:
        """Start all workers and wait until they are warm; then `models` says what they serve.

        Raises ModelFileError or SelfTestError for a model that cannot serve, and for two of one
        name; NotStarted.
        """
        starting = [start_worker(self._setup) for _ in range(self._workers)]
        try:
            for started in starting:
                self.models = _by_name(started.result().models)
        except BaseException:
            for started in starting:
                started.add_done_callback(_end)
            raise
        self._seats = [Seat(self._setup, self._jobs, each.result()) for each in starting]

    def attach(self) -> None:
        """Have the event loop that runs, and no other, hand work to the workers."""
        self._tasks = [asyncio.create_task(seat.run()) for seat in self._seats]

    def submit(self, work: Task, expires: float | None = None) -> Job:
        """Queue one mesh, to be classified by `expires` on the monotonic clock; with None, within
        the setup's seconds of when a worker begins with it.

        The job's future gives a prediction, or raises MeshError,
        DeadlineExceeded or TaskFailed. Work that waits can be cancelled, and is forgotten at once;
        what runs, runs on to its deadline: to end it costs more than to finish it.
        """
        job = Job(work, expires)
        self._jobs.put(job)
        return job

    @property
    def alive(self) -> int:
        """How many workers are warm."""
        return sum(seat.alive for seat in self._seats)

    @property
    def restarts(self) -> int:
        """How many workers were replaced so far."""
        return sum(seat.restarts for seat in self._seats)

    def close(self) -> None:
        """End all workers at once, whatever they run; work that waits is cancelled.

        In the event loop that they are attached to, if there is one.
        """
        self._jobs.close()
        for seat in self._seats:
            seat.close()

    async def wait_closed(self) -> None:
        """Wait until nothing is left of a pool that was closed."""
        if self._tasks:
            await asyncio.wait(self._tasks, timeout=CLOSE_SECONDS)


def _end(started: Future[Worker]) -> None:
    if started.exception() is None:
        started.result().end()


def _by_name(models: list[ModelInfo]) -> dict[str, ModelInfo]:
    by_name = {model.card.name: model for model in models}
    if len(by_name) < len(models):
        names = ", ".join(model.card.name for model in models)
        raise ModelFileError(f"models are told apart by their names, but these are: {names}")
    return by_name
