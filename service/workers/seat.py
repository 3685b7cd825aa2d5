"""What keeps one worker at work, and replaces it when it dies."""

import asyncio
import logging
import time
from contextlib import suppress

from meshconv3d.service.prediction import Prediction
from meshconv3d.service.workers.jobs import Job, Jobs
from meshconv3d.service.workers.tasks import Setup, Task
from meshconv3d.service.workers.worker import (
    DeadlineExceeded,
    NotStarted,
    Worker,
    crashed,
    start_worker,
)

log = logging.getLogger(__name__)

# How often an idle worker is looked after, and how long until one that does not start is tried
# again, in seconds.
CHECK_SECONDS = 0.5
RETRY_SECONDS = 1.0
# Workers that may die as the same work is handed to them. Of the last of them it is known that it
# lived until then.
ATTEMPTS = 2
# So long, in seconds, work that was handed over ahead waits for the one before it. Then that one
# takes its time, and another worker may be free before it is done.
AHEAD_SECONDS = 0.05
# Larger work is not handed over ahead: what is taken back was brought over for nothing.
AHEAD_BYTES = 64 * 1024


class Seat:
    """Takes work from the queue for one worker, and a new worker for one that died.

    A worker that has answered would wait for the event loop, and that for all else of a busy
    service. So it is handed its next work while it does the one before.
    """

    def __init__(self, setup: Setup, jobs: Jobs, worker: Worker) -> None:
        self._setup = setup
        self._jobs = jobs
        self._worker = worker
        # What the worker is to do next, and the number under which it has it.
        self._ahead: tuple[Job, int] | None = None
        self._closing = False
        self.restarts = 0

    @property
    def alive(self) -> bool:
        """Whether there is a worker, and it is warm."""
        return self._worker.alive

    def close(self) -> None:
        """Take no more work, and lose what the worker has in hand."""
        self._closing = True
        self._worker.end()

    async def run(self) -> None:
        """Keep the worker at work until the seat is closed."""
        await self._worker.attach()
        try:
            while not self._closing:
                await self._do_next(self._worker)
                self._worker = await self._living(self._worker)
        finally:
            self._worker.end()
            self._put_back_ahead()

    async def _do_next(self, worker: Worker) -> None:
        """Wait for a piece of work, and do it."""
        job, number = self._ahead or (await self._jobs.take(CHECK_SECONDS), None)
        self._ahead = None
        # To look after the worker each time would take longer than to hand it work.
        if number is None and (job is None or job.attempts) and not worker.alive:
            worker.end()
            if job is not None:
                self._jobs.put_back(job)
        elif job is not None:
            await self._do(job, number, worker)

    async def _do(self, job: Job, number: int | None, worker: Worker) -> None:
        """Do work, which the worker may have under a number, and tell what became of it."""
        expires = job.expires
        if expires is None:
            expires = time.monotonic() + self._setup.seconds
        if not job.begin():
            if number is not None:
                await self._drop(worker, number, expires)
            return
        work = job.work
        assert work is not None
        job.waited = time.perf_counter() - job.queued
        try:
            record = await self._classify(work, expires, worker, number)
        except NotStarted:
            # Who waits for it may end that, as long as there is no worker for it.
            if job.attempts < ATTEMPTS:
                self._jobs.put_back(job)
            else:
                job.fail(crashed("twice, as it was handed over"))
        except Exception as error:
            # Its traceback would keep this frame, with all the bytes, and the frame the error.
            job.fail(error.with_traceback(None))
        else:
            job.answer(record)

    async def _drop(self, worker: Worker, number: int, expires: float) -> None:
        """See that the worker is free of work for which nobody waits any more.

        What it has begun, it goes on with: that is waited for, for it would take its time from
        what comes next.
        """
        if not worker.take_back(number):
            with suppress(Exception):
                await self._answer(worker, number, expires)

    async def _classify(
        self, work: Task, expires: float, worker: Worker, number: int | None
    ) -> Prediction:
        """The record of work that the worker has under a number, or with None, is yet to be given.

        Raises MeshError, of which a crash is one; DeadlineExceeded; TaskFailed; NotStarted.
        """
        if time.monotonic() >= expires and (number is None or worker.take_back(number)):
            raise DeadlineExceeded
        if number is None:
            number = worker.hand_over(work)
        return await self._answer(worker, number, expires)

    async def _answer(self, worker: Worker, number: int, expires: float) -> Prediction:
        """The answer to what the worker does now, which is handed what it is to do next."""
        next_job = self._jobs.take_ahead(AHEAD_BYTES)
        if next_job is not None:
            assert next_job.work is not None
            self._ahead = next_job, worker.hand_over(next_job.work)
            try:
                return await worker.answer(number, min(expires, time.monotonic() + AHEAD_SECONDS))
            except TimeoutError:
                self._take_back_ahead(worker)
        try:
            return await worker.answer(number, expires)
        except TimeoutError:
            # One that has begun with its next has done this.
            if self._take_back_ahead(worker):
                worker.end()
            raise DeadlineExceeded from None

    def _take_back_ahead(self, worker: Worker) -> bool:
        """Whether the worker has nothing to do next, or nothing any more."""
        if self._ahead is not None and worker.take_back(self._ahead[1]):
            self._put_back_ahead()
        return self._ahead is None

    def _put_back_ahead(self) -> None:
        if self._ahead is not None:
            job, _ = self._ahead
            self._ahead = None
            self._jobs.put_back(job)

    async def _living(self, worker: Worker) -> Worker:
        """The worker itself, or if it died, a new one.

        One that had begun with what was to be next is asked for that first: it may have answered,
        or died of it.
        """
        while worker.ended and not self._closing and self._take_back_ahead(worker):
            try:
                worker = await asyncio.wrap_future(start_worker(self._setup))
                await worker.attach()
                self.restarts += 1
                log.warning("a worker ended, and another has taken its place")
            except Exception as error:
                log.error("a worker does not start, which is tried again: %s", error)
                await asyncio.sleep(RETRY_SECONDS)
        return worker
