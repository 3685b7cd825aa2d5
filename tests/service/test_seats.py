"""One seat of a pool, at whose worker the test sits."""

import asyncio
import time
from typing import cast

import pytest

from meshconv3d.model.loading import Limits
from meshconv3d.service.prediction import Prediction
from meshconv3d.service.workers import DeadlineExceeded, Setup, Task
from meshconv3d.service.workers.jobs import Job, Jobs
from meshconv3d.service.workers.seat import Seat
from meshconv3d.service.workers.worker import Worker
from tests.results import prediction
from tests.service.test_jobs import in_a_loop

SETUP = Setup((), Limits(), memory_bytes=0, seconds=30.0)
RECORD = prediction()


class Played:
    """A worker that has begun with all that it was handed. answers: by the number of the work."""

    def __init__(self, answers: dict[int, Prediction | Exception]) -> None:
        self.answers = answers
        self.handed = 0
        self.ended = False

    @property
    def alive(self) -> bool:
        return not self.ended

    async def attach(self) -> None:
        pass

    def hand_over(self, _: Task) -> int:
        self.handed += 1
        return self.handed

    def take_back(self, _: int) -> bool:
        return False

    async def answer(self, number: int, until: float) -> Prediction:
        answer = self.answers.get(number)
        if answer is None:
            await asyncio.sleep(max(until - time.monotonic(), 0.0))
            raise TimeoutError
        if isinstance(answer, Exception):
            raise answer
        return answer

    def end(self) -> None:
        self.ended = True


async def lived_through(worker: Played, jobs: list[Job]) -> bool:
    """Whether the worker was still alive when the jobs were done."""
    queue = Jobs()
    for job in jobs:
        queue.put(job)
    seat = Seat(SETUP, queue, cast(Worker, worker))
    running = asyncio.create_task(seat.run())
    await asyncio.wait({job.future for job in jobs}, timeout=10)
    alive = worker.alive
    seat.close()
    running.cancel()
    return alive


def job(seconds: float = 30.0) -> Job:
    return Job(Task("any", b"v", None, None), time.monotonic() + seconds)


@in_a_loop
async def test_a_worker_that_is_late_but_has_gone_on_is_not_ended() -> None:
    """That would end what it does now, which has its own time."""
    late, following = job(0.1), job()
    assert await lived_through(Played({2: RECORD}), [late, following])
    with pytest.raises(DeadlineExceeded):
        late.future.result()
    assert following.future.result() is RECORD
