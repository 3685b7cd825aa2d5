"""The processes of a running service, and what can happen to them."""

import os
import signal
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path


def children(parent: int) -> list[int]:
    """Process ids of those that a process started."""
    found = []
    for stat in Path("/proc").glob("[0-9]*/stat"):
        try:
            state, ppid = stat.read_text().rpartition(")")[2].split()[:2]
        except OSError:
            continue  # ended in between
        if int(ppid) == parent and state != "Z":
            found.append(int(stat.parent.name))
    return found


def workers(service: int) -> list[int]:
    """The workers of a service: those that its fork server started."""
    return [worker for child in children(service) for worker in children(child)]


def idle(process: int) -> bool:
    """Whether it waits for something, or is gone."""
    try:
        state = Path(f"/proc/{process}/stat").read_text().rpartition(")")[2].split()[0]
    except FileNotFoundError:
        return True
    return state in "SZ"


def family(service: int) -> list[int]:
    """All that came from a service, without itself."""
    return [*children(service), *workers(service)]


@contextmanager
def held(processes: list[int]) -> Iterator[None]:
    """Processes that hang for a while, if they are not killed meanwhile."""
    for process in processes:
        os.kill(process, signal.SIGSTOP)
    try:
        yield
    finally:
        for process in processes:
            with suppress(ProcessLookupError):
                os.kill(process, signal.SIGCONT)


def until(true: Callable[[], object], seconds: float = 20.0) -> None:
    """Wait for something that has to happen."""
    end = time.monotonic() + seconds
    while not true():
        assert time.monotonic() < end, "it does not happen"
        time.sleep(0.02)
