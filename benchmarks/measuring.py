"""Time and memory of calls on one thread, and the yardstick, their unit.

The yardstick is one product of two 1024 x 1024 float32 matrices on one thread. Machines differ, and
one machine drifts; what something costs in yardsticks of the same process stays.
"""

import multiprocessing
import time
from collections.abc import Callable, Iterator, Mapping
from concurrent.futures import ProcessPoolExecutor
from contextlib import contextmanager
from pathlib import Path
from typing import ParamSpec, TypeVar

import torch

Given = ParamSpec("Given")
Result = TypeVar("Result")

YARDSTICK_SIDE = 1024
# One turn of a call: long enough for its data to be in the cache again after the others' turns.
TURN = 0.02  # seconds
LEAST_TURNS = 3
STATUS = "/proc/self/status"


def best(calls: Mapping[str, Callable[[], object]], seconds: float = 1.0) -> dict[str, float]:
    """Least processor time of each call in milliseconds, by name, after one to warm up.

    They take turns for about `seconds` each, so that a disturbance meets all alike. What else a
    machine does only ever adds to a time: the least is closest to the call's own. It is the time
    of the processor, which on one thread and an idle machine is that of the clock, and on a busy
    one leaves out the turns of others.
    """
    for call in calls.values():
        call()
    least = dict.fromkeys(calls, float("inf"))
    end = time.perf_counter() + seconds * len(calls)
    turns = 0
    while turns < LEAST_TURNS or time.perf_counter() < end:
        for name, call in calls.items():
            least[name] = min(least[name], _turn(call))
        turns += 1
    return {name: elapsed * 1000 for name, elapsed in least.items()}


def _turn(call: Callable[[], object]) -> float:
    least = float("inf")
    end = time.perf_counter() + TURN
    while True:
        started = time.process_time()
        call()
        least = min(least, time.process_time() - started)
        if time.perf_counter() >= end:
            return least


def yardstick() -> Callable[[], object]:
    """The call whose time is one yardstick; torch computes on one thread from here on."""
    torch.set_num_threads(1)
    generator = torch.Generator().manual_seed(0)
    a, b = (torch.rand(YARDSTICK_SIDE, YARDSTICK_SIDE, generator=generator) for _ in range(2))
    out = torch.empty_like(a)
    return lambda: torch.mm(a, b, out=out)


class Peak:
    """Memory above what the process held before, in MB; known once the block has ended."""

    megabytes: float


@contextmanager
def peak_memory() -> Iterator[Peak]:
    """Measure the peak memory of a block above that before it. Linux only."""
    peak = Peak()
    before = _field(STATUS, "VmRSS")
    Path("/proc/self/clear_refs").write_text("5")  # forgets the process's peak
    yield peak
    peak.megabytes = _field(STATUS, "VmHWM") - before


def process_peak() -> float:
    """Peak memory of this process, in MB. Linux only."""
    return _field(STATUS, "VmHWM")


def available_memory() -> float:
    """MB that this machine has free. Linux only."""
    return _field("/proc/meminfo", "MemAvailable")


def _field(file: str, name: str) -> float:
    """A field of a file in /proc that counts kB, in MB."""
    lines = Path(file).read_text().splitlines()
    return next(int(line.split()[1]) for line in lines if line.startswith(name)) / 1024


def apart(
    function: Callable[Given, Result], *arguments: Given.args, **named: Given.kwargs
) -> Result:
    """Result of a function that runs in a new process."""
    spawn = multiprocessing.get_context("spawn")
    with ProcessPoolExecutor(1, spawn) as pool:
        return pool.submit(function, *arguments, **named).result()
