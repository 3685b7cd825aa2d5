"""The queue of a pool of workers."""

import threading

from service.workers.jobs import Job, Jobs
from service.workers.tasks import Work
from tests.processes import until


def job(size: int = 1) -> Job:
    return Job(Work("model", b"x" * size, None, None), None)


def test_jobs_are_taken_in_order_and_what_is_put_back_is_first() -> None:
    jobs, (one, two, three) = Jobs(), (job(), job(), job())
    for each in (one, two, three):
        jobs.put(each)
    assert jobs.take(0.0) is one
    assert jobs.take_ahead(1) is two
    jobs.put_back(two)
    assert jobs.take(0.0) is two
    assert jobs.take(0.0) is three
    assert jobs.take(0.0) is None
    assert jobs.take_ahead(1) is None


def test_what_is_large_is_not_taken_ahead_and_stays_first() -> None:
    jobs, (large, small) = Jobs(), (job(3), job(2))
    jobs.put(large)
    jobs.put(small)
    assert jobs.take_ahead(2) is None
    assert jobs.take(0.0) is large
    assert jobs.take_ahead(2) is small


def test_nothing_is_taken_ahead_of_one_who_would_begin_it() -> None:
    jobs, taken = Jobs(), list[Job | None]()
    idle = threading.Thread(target=lambda: taken.append(jobs.take(20.0)))
    idle.start()
    until(lambda: jobs.idle)
    jobs.put(only := job())
    ahead = jobs.take_ahead(1)
    idle.join()
    assert (ahead, taken) == (None, [only])


def test_a_closed_queue_cancels_what_is_there_and_what_comes() -> None:
    jobs, (there, comes, comes_back) = Jobs(), (job(), job(), job())
    jobs.put(there)
    jobs.close()
    jobs.put(comes)
    jobs.put_back(comes_back)
    for each in (there, comes, comes_back):
        assert each.future.cancelled()
        assert each.work is None  # nor are its bytes kept
    assert jobs.take(0.0) is None
