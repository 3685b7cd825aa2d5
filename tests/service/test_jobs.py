"""The queue of a pool of workers."""

import asyncio
from collections.abc import Awaitable, Callable
from functools import wraps

import anyio

from meshconv3d.service.workers.jobs import Job, Jobs
from meshconv3d.service.workers.tasks import Task


def in_a_loop(test: Callable[[], Awaitable[None]]) -> Callable[[], None]:
    """A test that is a coroutine."""

    @wraps(test)
    def run() -> None:
        anyio.run(test)

    return run


def job(size: int = 1) -> Job:
    return Job(Task("model", b"x" * size, None, None), None)


@in_a_loop
async def test_jobs_are_taken_in_order_and_what_is_put_back_is_first() -> None:
    jobs, (one, two, three) = Jobs(), (job(), job(), job())
    for each in (one, two, three):
        jobs.put(each)
    assert await jobs.take(0.0) is one
    assert jobs.take_ahead(1) is two
    jobs.put_back(two)
    assert await jobs.take(0.0) is two
    assert await jobs.take(0.0) is three
    assert await jobs.take(0.0) is None
    assert jobs.take_ahead(1) is None


@in_a_loop
async def test_what_is_large_is_not_taken_ahead_and_stays_first() -> None:
    jobs, (large, small) = Jobs(), (job(3), job(2))
    jobs.put(large)
    jobs.put(small)
    assert jobs.take_ahead(2) is None
    assert await jobs.take(0.0) is large
    assert jobs.take_ahead(2) is small


@in_a_loop
async def test_nothing_is_taken_ahead_of_one_who_would_begin_it() -> None:
    jobs = Jobs()
    idle = asyncio.create_task(jobs.take(20.0))
    await asyncio.sleep(0)
    jobs.put(only := job())
    assert jobs.take_ahead(1) is None
    assert await idle is only


@in_a_loop
async def test_who_waits_no_longer_is_handed_nothing() -> None:
    jobs = Jobs()
    assert await jobs.take(0.01) is None
    jobs.put(only := job())
    assert await jobs.take(0.0) is only


@in_a_loop
async def test_what_was_cancelled_is_not_taken_ahead() -> None:
    jobs, (cancelled, wanted) = Jobs(), (job(), job())
    jobs.put(cancelled)
    jobs.put(wanted)
    assert cancelled.cancel()
    await asyncio.sleep(0)
    assert cancelled.work is None  # nor are its bytes kept
    assert jobs.take_ahead(1) is wanted


@in_a_loop
async def test_what_has_begun_cannot_be_cancelled() -> None:
    begun, cancelled = job(), job()
    assert begun.begin()
    assert not begun.cancel()
    assert cancelled.cancel()
    assert not cancelled.begin()


@in_a_loop
async def test_a_closed_queue_cancels_what_is_there_and_what_comes() -> None:
    jobs, (there, comes, comes_back) = Jobs(), (job(), job(), job())
    jobs.put(there)
    jobs.close()
    jobs.put(comes)
    jobs.put_back(comes_back)
    await asyncio.sleep(0)
    for each in (there, comes, comes_back):
        assert each.future.cancelled()
        assert each.work is None
    assert await jobs.take(0.0) is None


@in_a_loop
async def test_a_closed_queue_lets_those_go_who_wait() -> None:
    jobs = Jobs()
    idle = asyncio.create_task(jobs.take(20.0))
    await asyncio.sleep(0)
    jobs.close()
    assert await asyncio.wait_for(idle, 1.0) is None
