"""A pool of warm worker processes behind one queue.

Each worker has a thread that takes a job from the queue, hands it to the process and waits for the
answer over a socket of its own. Process pools of libraries share one pipe and one lock: a worker
that is killed while it reads or writes breaks them for all, see `docs/operations.md`.
"""

import itertools
import logging
import queue
import threading
import time
from collections.abc import Sequence
from concurrent.futures import CancelledError, Future

from meshconv3d.service.models import ModelInfo
from meshconv3d.service.prediction import Prediction
from meshconv3d.service.workers.tasks import Setup, Task
from meshconv3d.service.workers.worker import DeadlineExceeded, Worker, crashed

log = logging.getLogger(__name__)

# How often an idle worker is checked, and the pause after one that did not start, in seconds.
CHECK_SECONDS = 0.5
RETRY_SECONDS = 1.0
# Workers that may end as a job is handed to them, before the job is given up.
ATTEMPTS = 2


class Job(Future[Prediction]):
    """A task in the pool. `result` gives the prediction, or raises MeshError, DeadlineExceeded,
    TaskFailed, or CancelledError where the job was cancelled or the pool closed.

    Threads wait for it; an event loop awaits `asyncio.wrap_future(job)`. queued_seconds: time until
    a worker began with it. attempts: workers that began. Jobs are in the order of submission.
    """

    _numbers = itertools.count()

    def __init__(self, task: Task, expires: float | None) -> None:
        """expires: see `WorkerPool.submit`."""
        super().__init__()
        self.task: Task | None = task
        self.expires = expires
        self.queued_seconds = 0.0
        self.attempts = 0
        self._number = next(self._numbers)
        self._submitted = time.monotonic()
        self._begun = False
        self._lock = threading.Lock()

    def __lt__(self, other: "Job") -> bool:
        return self._number < other._number

    def begin(self) -> bool:
        """Mark the job as begun, after which it cannot be cancelled. False if it was before."""
        with self._lock:
            self._begun = not self.done()
        self.attempts += 1
        self.queued_seconds = time.monotonic() - self._submitted
        return self._begun

    def wait_again(self) -> None:
        """Mark the job as not begun: its worker ended before it had read it."""
        self._begun = False

    def cancel(self) -> bool:
        """Drop the job, unless a worker has begun with it. Returns whether it is dropped."""
        with self._lock:
            if self._begun or self.done():
                return self.cancelled()
            self.task = None  # the job may stay in the queue for long, its bytes may not
            super().cancel()
            self.set_running_or_notify_cancel()
            return True

    def finish(self, result: Prediction | Exception) -> None:
        """Give the result, or the error in its place."""
        self.task = None
        if isinstance(result, Exception):
            self.set_exception(result)
        else:
            self.set_result(result)


class WorkerPool:
    """Worker processes behind one queue. A file that crashes its worker costs its own job alone.

    models: what the workers serve, by name, once they have started.

    >>> pool = WorkerPool(Setup([ModelFile.read("shrec11")], Limits(), 2**31, 30.0), workers=2)
    >>> pool.start()
    >>> pool.submit(Task("shrec11", content, None, "obj")).result().label
    """

    def __init__(self, setup: Setup, workers: int) -> None:
        self.models: dict[str, ModelInfo] = {}
        self.closed = False
        self.jobs: queue.PriorityQueue[Job] = queue.PriorityQueue()
        self._supervisors = [_Supervisor(self, setup) for _ in range(workers)]

    def start(self) -> None:
        """Start all workers and wait until they are warm.

        Raises what `tasks.warm_up` raises, and NotStarted for a process that ended.
        """
        for supervisor in self._supervisors:
            supervisor.start()
        try:
            for supervisor in self._supervisors:
                models = supervisor.started.result()
                self.models = {model.card.name: model for model in models}
        except BaseException:
            self.close()
            raise

    def submit(self, task: Task, expires: float | None = None) -> Job:
        """Queue one mesh. expires: on the monotonic clock; None for the setup's seconds from when a
        worker begins with it. What has begun runs to its end or deadline."""
        job = Job(task, expires)
        self.put(job)
        return job

    def put(self, job: Job) -> None:
        """Queue a job, or queue it again, by its number."""
        self.jobs.put(job)
        if self.closed:
            self._cancel_jobs()

    @property
    def alive(self) -> int:
        """Number of workers that are warm."""
        return sum(supervisor.alive for supervisor in self._supervisors)

    @property
    def restarts(self) -> int:
        """Number of workers that were replaced so far."""
        return sum(supervisor.restarts for supervisor in self._supervisors)

    def close(self) -> None:
        """Kill all workers at once; all jobs that are left raise CancelledError."""
        self.closed = True
        self._cancel_jobs()
        for supervisor in self._supervisors:
            supervisor.kill()

    def _cancel_jobs(self) -> None:
        while not self.jobs.empty():
            try:
                self.jobs.get_nowait().cancel()
            except queue.Empty:
                return  # another thread took it


class _Supervisor(threading.Thread):
    """Hands jobs to one worker, and replaces it when it dies.

    started: the models of the first worker, or the error for which there is none. alive: whether
    the worker is warm. restarts: number of workers that were replaced.
    """

    def __init__(self, pool: WorkerPool, setup: Setup) -> None:
        super().__init__(name="worker-supervisor", daemon=True)
        self.started: Future[Sequence[ModelInfo]] = Future()
        self.alive = False
        self.restarts = 0
        self._pool = pool
        self._setup = setup
        self._worker: Worker | None = None

    def run(self) -> None:
        """Start the worker and keep it at work until the pool is closed."""
        try:
            self.started.set_result(self._start_worker())
        except Exception as error:
            self.started.set_exception(error)
            return
        while not self._pool.closed:
            if self.alive:
                self._take_job()
            else:
                self._replace_worker()

    def kill(self) -> None:
        """End the worker, for a pool that is closed."""
        if self._worker is not None:
            self._worker.kill()

    def _start_worker(self) -> Sequence[ModelInfo]:
        """Raises what `Worker` raises."""
        self._worker = Worker(self._setup)
        if self._pool.closed:
            self._worker.kill()
        models = self._worker.warm_up()
        self.alive = True
        return models

    def _replace_worker(self) -> None:
        try:
            self._start_worker()
        except Exception as error:
            if not self._pool.closed:
                log.error("a worker does not start, which is tried again: %s", error)
                time.sleep(RETRY_SECONDS)
            return
        self.restarts += 1
        log.warning("a worker ended, and another has taken its place")

    def _take_job(self) -> None:
        """Wait for a job and run it; if there is none, look after the worker."""
        assert self._worker is not None
        try:
            job = self._pool.jobs.get(timeout=CHECK_SECONDS)
        except queue.Empty:
            self.alive = self._worker.lives()
            return
        # Not before every job: to ask the system takes longer than to hand a job over.
        if job.attempts and not self._worker.lives():
            self.alive = False
            self._pool.put(job)
        elif job.begin():
            self._run(job, self._worker)

    def _run(self, job: Job, worker: Worker) -> None:
        """Finish a job, or queue it again where the worker ended before it had read it."""
        assert job.task is not None
        now = time.monotonic()
        expires = now + self._setup.seconds if job.expires is None else job.expires
        result = DeadlineExceeded() if now >= expires else worker.classify(job.task, expires)
        self.alive = not worker.ended
        if self._pool.closed and worker.ended:
            job.finish(CancelledError())
        elif result is not None:
            job.finish(result)
        elif job.attempts < ATTEMPTS:
            job.wait_again()
            self._pool.put(job)
        else:
            job.finish(crashed("twice, as it was handed over"))
