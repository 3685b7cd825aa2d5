"""The two executors of one machine: the same results, whatever the files do."""

import os
import threading
from collections.abc import Collection, Iterator
from concurrent.futures import Future, ThreadPoolExecutor
from hashlib import sha256
from pathlib import Path

import numpy as np
import pytest

from meshconv3d.model.loading import Limits
from meshconv3d.service.batch.listing import Listing
from meshconv3d.service.batch.running import (
    Budget,
    Executor,
    FileResult,
    Options,
    PoolExecutor,
    SerialExecutor,
    in_order,
)
from meshconv3d.service.classifier import Classifier
from meshconv3d.service.models import ModelFile
from meshconv3d.service.records import record
from meshconv3d.service.workers import Setup, Task, WorkerPool, predict
from tests.model.loading import loading_builders as build
from tests.processes import held, until
from tests.processes import workers as workers_of

MEMORY = 2**28
OPTIONS = Options("tiny", MEMORY)


@pytest.fixture
def serial(model_file: Path) -> Executor:
    classifier = Classifier.load(str(model_file))
    return SerialExecutor(lambda task: predict(task, classifier, False), OPTIONS)


@pytest.fixture(scope="module")
def workers(model_file: Path) -> Iterator[PoolExecutor]:
    setup = Setup([ModelFile.read(str(model_file))], Limits(), MEMORY, seconds=60.0)
    pool = WorkerPool(setup, 2)
    pool.start()
    with PoolExecutor(pool, 2, OPTIONS) as executor:
        yield executor


def never(_: str) -> Collection[str]:
    return ()


def timeless(one: FileResult) -> dict:
    found = record(one.file.name, one.result, 1)
    return found.model_dump(by_alias=True) | {"timings_ms": None}


def test_workers_give_the_records_of_one_process(
    workers: PoolExecutor, serial: Executor, meshes: Path
) -> None:
    listing = Listing([str(meshes)] * 10)
    expected = [timeless(one) for one in serial.results(listing, never)]
    found = [timeless(one) for one in workers.results(listing, never)]
    assert len(found) == 50
    assert found == expected


def large_stl(faces: int) -> bytes:
    records = np.zeros(faces, dtype=[("values", "<f4", 12), ("attribute", "<u2")])
    records["values"] = np.random.default_rng(0).random((faces, 12))
    return bytes(80) + np.uint32(faces).tobytes() + records.tobytes()


def test_a_hostile_file_costs_its_own_record(
    workers: PoolExecutor, meshes: Path, tmp_path: Path
) -> None:
    """One takes all the memory that it may, one is not read at all."""
    for number in range(20):
        (tmp_path / f"{number:02}.obj").write_bytes((meshes / "ring.obj").read_bytes())
    (tmp_path / "05-memory.stl").write_bytes(large_stl(2_000_000))
    with (tmp_path / "15-bytes.stl").open("wb") as file:
        file.truncate(2**40)
    listing = Listing([str(tmp_path)])
    results = workers.results(listing, never)
    records = {Path(record["file"]).stem: record for record in map(timeless, results)}
    faults = {name: one["error"]["fault"] for name, one in records.items() if "error" in one}
    assert faults == {"05-memory": "too-much-memory", "15-bytes": "too-much-memory"}
    assert len(records) == 22


def test_the_deadline_begins_with_the_work(model_file: Path, meshes: Path) -> None:
    """Not as it is queued: behind one that takes all its time, the other has all of its own."""
    setup = Setup([ModelFile.read(str(model_file))], Limits(), MEMORY, seconds=5.0)
    before = set(workers_of(os.getpid()))
    pool = WorkerPool(setup, 1)
    pool.start()
    with PoolExecutor(pool, 1, OPTIONS) as executor:
        held_up = set(workers_of(os.getpid())) - before
        with held(list(held_up)):
            results = executor.results(Listing([str(meshes / "ring.obj")] * 2), never)
            # Each file is read in a thread of its own: either may be the first to be queued.
            assert {one.fault for one in results} == {"deadline", None}


def test_what_is_done_has_no_one(workers: PoolExecutor, serial: Executor, meshes: Path) -> None:
    def done_as(name: str) -> Collection[str]:
        path = meshes / ("ring.obj" if "ring" in name else "sheet.obj")
        return {sha256(path.read_bytes()).hexdigest()}  # of another file, for all but two

    for executor in (workers, serial):
        results = list(executor.results(Listing([str(meshes)]), done_as))
        assert len(results) == 3
        assert all(one.sha256 for one in results)


def test_the_listing_runs_ahead_only_so_far(workers: PoolExecutor, meshes: Path) -> None:
    """However many files come, of most nothing is known yet."""
    (ring,) = Listing([str(meshes / "ring.obj")])
    taken = 0

    def endless() -> Iterator:
        nonlocal taken
        while True:
            taken += 1
            yield ring

    results = workers.results(endless(), never)
    for number in range(1, 40):
        assert next(iter(results)).fault is None
        assert taken - number <= 1024


def test_a_stopped_executor_leaves_nothing_waiting(model_file: Path, meshes: Path) -> None:
    setup = Setup([ModelFile.read(str(model_file))], Limits(), MEMORY, seconds=30.0)
    pool = WorkerPool(setup, 1)
    pool.start()
    executor = PoolExecutor(pool, 1, OPTIONS)
    with executor:
        results = executor.results(Listing([str(meshes)] * 100), never)
        next(iter(results))
    executor._threads.shutdown(wait=True)  # would wait for ever
    late = pool.submit(Task("tiny", b"", None, None))
    until(late.cancelled)


def test_every_result_once_in_order_and_never_more_ahead() -> None:
    ahead = 5
    given = 0
    begun = 0
    waiting: list[tuple[Future[int], int]] = []

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

    results = []
    for result in in_order(begin, range(50), ahead):
        given += 1
        results.append(result)
    assert results == list(range(50))


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


def test_a_file_is_another_where_its_pieces_are(serial: Executor, tmp_path: Path) -> None:
    """What is done is told by the contents of both."""
    gltf, data = build.gltf_in_pieces()
    (tmp_path / "box.gltf").write_bytes(gltf)
    hashes = []
    for content in (data, data[:94] + b"\x80" + data[95:]):
        (tmp_path / "box.bin").write_bytes(content)
        [one] = serial.results(Listing([str(tmp_path)]), never)
        assert one.sha256 not in hashes
        hashes.append(one.sha256)
        assert not list(serial.results(Listing([str(tmp_path)]), lambda _: hashes))
    assert one.fault is None
