"""The pool of workers by itself, as any program may use it."""

import asyncio
import dataclasses
import errno
import gc
import os
import signal
import subprocess
import sys
import time
import weakref
from collections.abc import Iterator
from concurrent.futures import wait
from contextlib import contextmanager
from multiprocessing.context import ForkServerProcess
from pathlib import Path

import numpy as np
import pytest

from meshconv3d.export.metadata import ModelFileError
from meshconv3d.model.errors import LimitExceeded, MalformedFile, UnusableMesh
from meshconv3d.model.loading import Limits
from meshconv3d.service.classifier import Classifier
from meshconv3d.service.models import ModelFile
from meshconv3d.service.workers import (
    DeadlineExceeded,
    NotStarted,
    Setup,
    Task,
    WorkerPool,
)
from meshconv3d.service.workers.limits import KEPT_BYTES
from tests.commands import environment
from tests.processes import held, until, workers

MEMORY = 2**30


class Deadly(str):
    """A model's name that ends the worker that looks for it."""

    def __hash__(self) -> int:
        os._exit(3)


def setup(*models: ModelFile) -> Setup:
    return Setup(models, Limits(faces=600), MEMORY, seconds=30.0)


def soon() -> float:
    return time.monotonic() + 30


@contextmanager
def opened(model_file: Path, count: int) -> Iterator[tuple[WorkerPool, list[int]]]:
    """A pool, and its processes."""
    others = workers(os.getpid())
    pool = WorkerPool(setup(ModelFile.read(str(model_file))), count)
    pool.start()
    try:
        yield pool, [worker for worker in workers(os.getpid()) if worker not in others]
    finally:
        pool.close()


@pytest.fixture(scope="module")
def pool(model_file: Path) -> Iterator[WorkerPool]:
    with opened(model_file, 1) as (one, _):
        yield one


@pytest.fixture
def ring(meshes: Path) -> Task:
    return Task("tiny", (meshes / "ring.obj").read_bytes(), None, "obj")


def test_the_prediction_is_that_of_the_classifier(
    pool: WorkerPool, model_file: Path, meshes: Path
) -> None:
    content = (meshes / "ring.obj").read_bytes()
    found = pool.submit(Task("tiny", content, "a.obj", "obj"), soon()).result()
    here = Classifier.load(str(model_file)).classify(content, "obj")
    assert (found.model, found.classes, found.report) == (here.model, here.classes, here.report)
    assert np.array_equal(found.scores, here.scores)
    assert np.array_equal(found.probabilities, here.probabilities)
    assert (found.novelty, found.unknown) == (here.novelty, here.unknown)
    assert set(found.timings_ms) == set(here.timings_ms)


def test_errors_cross_the_border_as_they_are(pool: WorkerPool) -> None:
    damaged = pool.submit(Task("tiny", b"OFF\n1", None, "off"), soon()).exception()
    assert isinstance(damaged, MalformedFile)
    assert damaged.fault
    text = "v 0 0 0\nv 1 0 0\nv 0 1 0\n" + "f 1 2 3\n" * 601
    error = pool.submit(Task("tiny", text.encode(), None, "obj"), soon()).exception()
    assert isinstance(error, LimitExceeded)
    assert (error.limit, error.value) == ("faces", 600)


def test_an_error_keeps_nothing_of_the_file_that_it_is_of(pool: WorkerPool) -> None:
    """Not even until garbage is collected: many large files may be damaged."""
    damaged = Task("tiny", b"OFF\n1", None, "off")
    left = weakref.ref(damaged)
    gc.disable()
    try:
        error = pool.submit(damaged, soon()).exception()
        del damaged
        until(lambda: left() is None)
    finally:
        gc.enable()
    assert isinstance(error, MalformedFile)


def test_work_whose_time_is_over_is_not_begun(pool: WorkerPool) -> None:
    with pytest.raises(DeadlineExceeded):
        pool.submit(Task("tiny", b"", None, None), time.monotonic() - 1).result()
    assert (pool.alive, pool.restarts) == (1, 0)


def test_work_that_waits_for_a_slow_one_is_done_by_another(model_file: Path, ring: Task) -> None:
    with opened(model_file, 2) as (pool, [slow, other]):
        with held([slow]):
            with held([other]):
                futures = [pool.submit(ring, soon()) for _ in range(4)]
                assert not wait(futures, timeout=0.3).done
            until(lambda: sum(future.done() for future in futures) == 3)
            assert wait(futures, timeout=0.3).not_done
        assert len({future.result().label for future in futures}) == 1
        assert pool.restarts == 0


def test_work_that_is_cancelled_is_not_done(model_file: Path, ring: Task) -> None:
    """Neither what the worker has as its next nor what is queued behind that."""
    deadly = dataclasses.replace(ring, model=Deadly("tiny"))
    with opened(model_file, 1) as (pool, processes):
        with held(processes):
            tasks = (ring, deadly, deadly, ring)
            first, *cancelled, last = [pool.submit(work, soon()) for work in tasks]
            assert not wait([first], timeout=0.3).done
            for future in cancelled:
                future.cancel()
        assert first.result().label == last.result().label
        assert pool.restarts == 0


def test_a_worker_that_dies_loses_nothing_that_it_had_not_begun(
    model_file: Path, ring: Task
) -> None:
    with opened(model_file, 1) as (pool, processes):
        with held(processes):
            futures = [pool.submit(ring, soon()) for _ in range(3)]
            assert not wait(futures, timeout=0.3).done
            os.kill(processes[0], signal.SIGKILL)
        assert len({future.result().label for future in futures}) == 1
        assert pool.restarts == 1


def test_a_task_that_ends_its_worker_costs_no_other(model_file: Path, ring: Task) -> None:
    deadly = dataclasses.replace(ring, model=Deadly("tiny"))
    with opened(model_file, 1) as (pool, processes):
        with held(processes):
            first, second, third = [pool.submit(task, soon()) for task in (ring, deadly, ring)]
        with pytest.raises(UnusableMesh, match="exit code 3"):
            second.result()
        assert first.result().label == third.result().label
        assert pool.restarts == 1


def test_a_job_can_be_cancelled_until_a_worker_begins_with_it(model_file: Path, ring: Task) -> None:
    with opened(model_file, 1) as (pool, processes):
        with held(processes):
            running, waiting = pool.submit(ring, soon()), pool.submit(ring, soon())
            until(lambda: running.attempts)
            assert not running.cancel()
            assert waiting.cancel()
            assert waiting.cancel()
            assert waiting.task is None  # nor are its bytes kept
            assert wait([waiting], timeout=0).done
        assert running.result().label
        assert not running.cancel()


def test_an_event_loop_awaits_jobs(pool: WorkerPool, ring: Task) -> None:
    async def play() -> list[str]:
        jobs = [asyncio.wrap_future(pool.submit(ring, soon())) for _ in range(3)]
        return [prediction.label for prediction in await asyncio.gather(*jobs)]

    assert len(set(asyncio.run(play()))) == 1


def test_long_names_do_not_keep_who_hands_work_over(model_file: Path, ring: Task) -> None:
    with opened(model_file, 1) as (pool, processes), held(processes):
        hanging = pool.submit(ring, time.monotonic() + 1)
        pool.submit(dataclasses.replace(ring, file="a" * 1_000_000), soon())
        with pytest.raises(DeadlineExceeded):
            hanging.result(timeout=10)


def test_what_a_mesh_took_is_given_back(model_file: Path, ring: Task) -> None:
    """So that the next may take as much."""
    corners = np.zeros(400_000, [("values", "<f4", 12), ("attribute", "<u2")])
    corners["values"] = np.random.default_rng(0).random((len(corners), 12))
    content = bytes(80) + np.uint32(len(corners)).tobytes() + corners.tobytes()
    large = dataclasses.replace(ring, content=content, declared="stl")
    limits, model = Limits(), [ModelFile.read(str(model_file))]
    pool = WorkerPool(Setup(model, limits, 2**26, seconds=30.0), 1)
    before = workers(os.getpid())
    pool.start()
    try:
        (worker,) = set(workers(os.getpid())) - set(before)
        assert pool.submit(ring).result().label
        warm = resident(worker)
        for _ in range(3):
            error = pool.submit(large).exception()
            assert isinstance(error, UnusableMesh)
            assert error.fault == "too-much-memory"
        assert pool.submit(ring).result().label
        assert resident(worker) < warm + KEPT_BYTES
        assert pool.restarts == 0
    finally:
        pool.close()


def resident(process: int) -> int:
    """Bytes of memory that a process holds."""
    return int(Path(f"/proc/{process}/statm").read_text().split()[1]) * os.sysconf("SC_PAGESIZE")


def test_a_stop_leaves_nobody_waiting(model_file: Path, ring: Task) -> None:
    with opened(model_file, 1) as (pool, processes), held(processes):
        futures = [pool.submit(ring, soon()) for _ in range(3)]
        pool.close()
        until(lambda: all(future.done() for future in futures))
        until(pool.submit(ring, soon()).cancelled)


def test_a_model_that_cannot_be_opened_is_told_by_its_path(tmp_path: Path) -> None:
    refused = WorkerPool(setup(ModelFile(tmp_path / "my.onnx", b"nothing")), workers=1)
    with pytest.raises(ModelFileError, match=r"my\.onnx"):
        refused.start()


def test_a_worker_that_is_gone_as_it_starts_is_told(
    model_file: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """As where the system ends it for want of memory: no broken pipe of the command's own."""

    def start(_: object) -> None:
        raise BrokenPipeError(errno.EPIPE, "Broken pipe")

    monkeypatch.setattr(ForkServerProcess, "start", start)
    with pytest.raises(NotStarted, match="a worker process does not start"):
        WorkerPool(setup(ModelFile.read(str(model_file))), workers=1).start()


# Prints the kernels that importing `preload` leaves uncompiled: no compiled kernel calls them,
# directly or through others.
UNCOMPILED = """
import sys
import meshconv3d.service.workers.preload
from numba.core.dispatcher import Dispatcher

kernels = {
    each
    for module in list(sys.modules.values())
    if module.__name__.startswith("meshconv3d.")
    for each in vars(module).values()
    if isinstance(each, Dispatcher)
}
reached = {kernel for kernel in kernels if kernel.signatures}
new = reached
while new:
    functions = [each.py_func for each in new]
    used = [f.__globals__.get(name) for f in functions for name in f.__code__.co_names]
    new = {each for each in used if isinstance(each, Dispatcher)} - reached
    reached |= new
assert len(reached) > 50
print(*sorted(kernel.__name__ for kernel in kernels - reached))
"""


def test_a_worker_begins_with_all_kernels_compiled() -> None:
    """Nobody's first mesh waits for the compiler, which takes seconds for a kernel."""
    command = [sys.executable, "-c", UNCOMPILED]
    left = subprocess.run(command, capture_output=True, text=True, check=True, env=environment())
    assert left.stdout.split() == []
