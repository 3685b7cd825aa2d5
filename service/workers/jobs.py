"""Work that waits for a worker, in order."""

import queue
import threading
import time
from collections import deque
from concurrent.futures import Future
from contextlib import suppress

from service.workers.tasks import Record, Work


class Job:
    """Work until it is done or cancelled. expires: on the monotonic clock, or None: some time after
    its beginning."""

    def __init__(self, work: Work, expires: float | None) -> None:
        self.work: Work | None = work
        self.queued = time.perf_counter()
        self.expires = expires
        self.future: Future[Record] = Future()
        self.future.add_done_callback(self._forget)

    def _forget(self, _: Future[Record]) -> None:
        self.work = None  # what was cancelled may stay in the queue for long, its bytes may not


class Jobs:
    """A queue from which work may be taken ahead of its time, and to which it can go back."""

    def __init__(self) -> None:
        self._jobs: deque[Job] = deque()
        # One for each job: whoever has it may take one.
        self._permits: queue.SimpleQueue[None] = queue.SimpleQueue()
        self._idle: set[int] = set()
        self._closed = False

    def put(self, job: Job) -> None:
        """Queue it behind all others."""
        self._jobs.append(job)
        self._permit()

    def put_back(self, job: Job) -> None:
        """Queue it before all others."""
        self._jobs.appendleft(job)
        self._permit()

    def _permit(self) -> None:
        self._permits.put(None)
        if self._closed:
            self._cancel_all()

    @property
    def idle(self) -> bool:
        """Whether somebody waits for work."""
        return bool(self._idle)

    def take(self, seconds: float) -> Job | None:
        """The first, which is waited for so long."""
        thread = threading.get_ident()
        self._idle.add(thread)
        try:
            self._permits.get(timeout=seconds)
        except queue.Empty:
            return None
        finally:
            self._idle.discard(thread)
        return self._jobs.popleft()

    def take_ahead(self, most_bytes: int) -> Job | None:
        """The first, if it has so few bytes, and nobody is there to begin with it at once."""
        if self.idle or not self._jobs:
            return None
        try:
            self._permits.get_nowait()
        except queue.Empty:
            return None
        job = self._jobs.popleft()
        if job.work is not None and job.work.size > most_bytes:
            self.put_back(job)
            return None
        return job

    def close(self) -> None:
        """Cancel all that is here, and all that still comes or comes back."""
        self._closed = True
        self._cancel_all()

    def _cancel_all(self) -> None:
        with suppress(queue.Empty):
            while True:
                self._permits.get_nowait()
                self._jobs.popleft().future.cancel()
