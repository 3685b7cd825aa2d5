"""Results of work that runs elsewhere, in its order or as they come; so many ahead, no more."""

from collections import deque
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import Future
from queue import SimpleQueue
from typing import TypeVar

Item = TypeVar("Item")
Result = TypeVar("Result")

# Pieces of work that have begun, or wait to, and whose results were not given yet. One that takes
# its whole deadline holds back, in order, the results of this many after it.
AHEAD = 1024


def in_order(
    begin: Callable[[Item], Future[Result]], items: Iterable[Item], ahead: int = AHEAD
) -> Iterator[Result]:
    """The results in the order of the items; of at most `ahead` items none is given yet."""
    begun: deque[Future[Result]] = deque()
    for item in items:
        begun.append(begin(item))
        while begun and (begun[0].done() or len(begun) >= ahead):
            yield begun.popleft().result()
    while begun:
        yield begun.popleft().result()


def as_they_come(
    begin: Callable[[Item], Future[Result]], items: Iterable[Item], ahead: int = AHEAD
) -> Iterator[Result]:
    """The results as they are there; of at most `ahead` items none is given yet."""
    done: SimpleQueue[Future[Result]] = SimpleQueue()
    missing = 0
    for item in items:
        begin(item).add_done_callback(done.put)
        missing += 1
        while not done.empty() or missing >= ahead:
            yield done.get().result()
            missing -= 1
    for _ in range(missing):
        yield done.get().result()
