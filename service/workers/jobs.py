"""Work that waits for a worker, in order."""

import asyncio
import time
from collections import deque

from meshconv3d.service.prediction import Prediction
from meshconv3d.service.workers.tasks import Task


class Job:
    """Work until it is done or cancelled. expires: on the monotonic clock, or None: some time after
    its beginning."""

    def __init__(self, work: Task, expires: float | None) -> None:
        self.work: Task | None = work
        self.queued = time.perf_counter()
        self.waited = 0.0  # seconds in the queue
        self.expires = expires
        self.future: asyncio.Future[Prediction] = asyncio.get_running_loop().create_future()
        self.future.add_done_callback(self._forget)
        # Workers that have begun with it.
        self.attempts = 0
        self._begun = False

    def begin(self) -> bool:
        """Say that it is done now, and cannot be cancelled any more. False if it was before."""
        self._begun = not self.future.done()
        self.attempts += 1
        return self._begun

    def wait_again(self) -> None:
        """Say that it is not done now after all."""
        self._begun = False

    def cancel(self) -> bool:
        """Have it not done. False if it is too late for that."""
        if self._begun or self.future.done():
            return False
        return self.future.cancel()

    def answer(self, record: Prediction) -> None:
        """Tell whoever waits for it."""
        if not self.future.done():
            self.future.set_result(record)

    def fail(self, error: Exception) -> None:
        """Tell whoever waits for it why there is no record."""
        if not self.future.done():
            self.future.set_exception(error)
            self.future.exception()  # it is no fault if nobody waits any more

    def _forget(self, _: asyncio.Future[Prediction]) -> None:
        self.work = None  # what is cancelled may stay in the queue for long, its bytes may not


class Jobs:
    """A queue from which work may be taken ahead of its time, and to which it can go back."""

    def __init__(self) -> None:
        self._jobs: deque[Job] = deque()
        # Those who wait for work; there is none as long as there are any.
        self._idle: deque[asyncio.Future[Job | None]] = deque()
        self._closed = False

    def put(self, job: Job) -> None:
        """Queue it behind all others."""
        if not self._handed(job):
            self._jobs.append(job)

    def put_back(self, job: Job) -> None:
        """Queue it before all others, and have it begun anew."""
        job.wait_again()
        if not self._handed(job):
            self._jobs.appendleft(job)

    def _handed(self, job: Job) -> bool:
        """Whether there is somebody who takes it at once, or nobody who ever will."""
        if self._closed:
            job.cancel()
        elif self._idle:
            self._idle.popleft().set_result(job)
        else:
            return False
        return True

    async def take(self, seconds: float) -> Job | None:
        """The first, which is waited for so long; None where there is none."""
        if self._jobs:
            return self._jobs.popleft()
        found = asyncio.get_running_loop().create_future()
        self._idle.append(found)
        try:
            await asyncio.wait((found,), timeout=seconds)
        finally:
            if not found.done():
                self._idle.remove(found)
        return found.result() if found.done() else None

    def take_ahead(self, most_bytes: int) -> Job | None:
        """The first, if it has so few bytes."""
        while self._jobs:
            work = self._jobs[0].work
            if work is not None and work.size > most_bytes:
                return None
            job = self._jobs.popleft()
            if work is not None:
                return job
        return None

    def close(self) -> None:
        """Cancel all that is here, and all that still comes or comes back."""
        self._closed = True
        while self._jobs:
            self._jobs.popleft().cancel()
        while self._idle:
            self._idle.popleft().set_result(None)
