"""Results of work elsewhere: their order, and how far it runs ahead."""

import threading
from concurrent.futures import Future, ThreadPoolExecutor

import pytest

from meshconv3d.service.batch.budget import Budget
from meshconv3d.service.batch.ordering import as_they_come, in_order


@pytest.mark.parametrize("arranged", [in_order, as_they_come])
def test_every_result_once_and_never_more_ahead(arranged) -> None:
    ahead = 5
    given = 0
    begun = 0

    def begin(item: int) -> Future[int]:
        nonlocal begun
        begun += 1
        assert begun - given <= ahead
        future: Future[int] = Future()
        waiting.append((future, item))
        if len(waiting) == ahead:  # the latest first, all at once
            while waiting:
                done, value = waiting.pop()
                done.set_result(value)
        return future

    waiting: list[tuple[Future[int], int]] = []
    results = []
    for result in arranged(begin, range(50), ahead):
        given += 1
        results.append(result)
    assert sorted(results) == list(range(50))
    if arranged is in_order:
        assert results == sorted(results)


def test_a_budget_is_never_overdrawn() -> None:
    budget = Budget(100)
    held = most = 0
    changing = threading.Lock()

    def use(size: int) -> None:
        nonlocal held, most
        with budget.held(size):
            with changing:
                held += size
                most = max(most, held)
            threading.Event().wait(0.001)
            with changing:
                held -= size

    with ThreadPoolExecutor(8) as threads:
        list(threads.map(use, [30, 60, 1, 99, 100, 50] * 20))
    assert most <= 100


def test_what_is_larger_than_the_budget_is_taken_alone() -> None:
    budget = Budget(10)
    taken = threading.Event()

    def take_one() -> None:
        with budget.held(1):
            taken.set()

    thread = threading.Thread(target=take_one, daemon=True)
    with budget.held(1000):
        thread.start()
        assert not taken.wait(0.2)
    assert taken.wait(5)
