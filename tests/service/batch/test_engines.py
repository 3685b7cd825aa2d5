"""The two engines: the same outcomes, whatever the files do."""

import json
import os
from collections.abc import Collection, Iterator
from hashlib import sha256
from pathlib import Path

import numpy as np
import pytest

from meshconv3d.model.loading import Limits
from meshconv3d.service.batch.classifying import Options, Outcome
from meshconv3d.service.batch.engines import Engine, Here, Workers
from meshconv3d.service.batch.listing import Listing
from meshconv3d.service.classifier import Classifier
from meshconv3d.service.models import ModelFile
from meshconv3d.service.workers import Setup, Task, ThreadedPool, predict
from tests.processes import held, until
from tests.processes import workers as workers_of

MEMORY = 2**28
OPTIONS = Options("tiny", 1, MEMORY)


@pytest.fixture
def here(model_file: Path) -> Engine:
    classifier = Classifier.load(str(model_file))
    return Here(lambda task: predict(task, classifier, False))


@pytest.fixture(scope="module", params=[True, False], ids=["ordered", "unordered"])
def workers(request: pytest.FixtureRequest, model_file: Path) -> Iterator[Workers]:
    setup = Setup([ModelFile.read(str(model_file))], Limits(), MEMORY, seconds=60.0)
    pool = ThreadedPool(setup, 2)
    pool.start()
    with Workers(pool, 2, request.param) as engine:
        yield engine


def never(_: str) -> Collection[str]:
    return ()


def timeless(outcome: Outcome) -> dict:
    return json.loads(outcome.record) | {"timings_ms": None}


def test_workers_give_the_records_of_one_process(
    workers: Workers, here: Engine, meshes: Path, request: pytest.FixtureRequest
) -> None:
    listing = Listing([str(meshes)] * 10)
    expected = [timeless(one) for one in here.outcomes(listing, OPTIONS, never)]
    found = [timeless(one) for one in workers.outcomes(listing, OPTIONS, never)]
    assert len(found) == 50
    if "unordered" in request.node.name:
        expected.sort(key=lambda record: record["file"])
        found.sort(key=lambda record: record["file"])
    assert found == expected


def large_stl(faces: int) -> bytes:
    records = np.zeros(faces, dtype=[("values", "<f4", 12), ("attribute", "<u2")])
    records["values"] = np.random.default_rng(0).random((faces, 12))
    return bytes(80) + np.uint32(faces).tobytes() + records.tobytes()


def test_a_hostile_file_costs_its_own_record(
    workers: Workers, meshes: Path, tmp_path: Path
) -> None:
    """One takes all the memory that it may, one is not read at all."""
    for number in range(20):
        (tmp_path / f"{number:02}.obj").write_bytes((meshes / "ring.obj").read_bytes())
    (tmp_path / "05-memory.stl").write_bytes(large_stl(2_000_000))
    with (tmp_path / "15-bytes.stl").open("wb") as file:
        file.truncate(2**40)
    listing = Listing([str(tmp_path)])
    outcomes = workers.outcomes(listing, OPTIONS, never)
    records = {Path(record["file"]).stem: record for record in map(timeless, outcomes)}
    faults = {name: one["error"]["fault"] for name, one in records.items() if "error" in one}
    assert faults == {"05-memory": "too-much-memory", "15-bytes": "too-much-memory"}
    assert len(records) == 22


def test_the_deadline_begins_with_the_work(model_file: Path, meshes: Path) -> None:
    """Not as it is queued: behind one that takes all its time, the other has all of its own."""
    setup = Setup([ModelFile.read(str(model_file))], Limits(), MEMORY, seconds=5.0)
    before = set(workers_of(os.getpid()))
    pool = ThreadedPool(setup, 1)
    pool.start()
    with Workers(pool, 1, ordered=True) as engine:
        held_up = set(workers_of(os.getpid())) - before
        with held(list(held_up)):
            outcomes = engine.outcomes(Listing([str(meshes / "ring.obj")] * 2), OPTIONS, never)
            # Each file is read in a thread of its own: either may be the first to be queued.
            assert {outcome.fault for outcome in outcomes} == {"deadline", None}


def test_what_is_done_has_no_outcome(workers: Workers, here: Engine, meshes: Path) -> None:
    def done_as(name: str) -> Collection[str]:
        path = meshes / ("ring.obj" if "ring" in name else "sheet.obj")
        return {sha256(path.read_bytes()).hexdigest()}  # of another file, for all but two

    for engine in (workers, here):
        outcomes = list(engine.outcomes(Listing([str(meshes)]), OPTIONS, done_as))
        assert len(outcomes) == 3
        assert all(outcome.sha256 for outcome in outcomes)


def test_the_listing_runs_ahead_only_so_far(workers: Workers, meshes: Path) -> None:
    """However many files come, of most nothing is known yet."""
    (ring,) = Listing([str(meshes / "ring.obj")])
    taken = 0

    def endless() -> Iterator:
        nonlocal taken
        while True:
            taken += 1
            yield ring

    outcomes = workers.outcomes(endless(), OPTIONS, never)
    for number in range(1, 40):
        assert next(iter(outcomes)).fault is None
        assert taken - number <= 1024


def test_a_stopped_engine_leaves_nothing_waiting(model_file: Path, meshes: Path) -> None:
    setup = Setup([ModelFile.read(str(model_file))], Limits(), MEMORY, seconds=30.0)
    pool = ThreadedPool(setup, 1)
    pool.start()
    engine = Workers(pool, 1, ordered=True)
    with engine:
        outcomes = engine.outcomes(Listing([str(meshes)] * 100), OPTIONS, never)
        next(iter(outcomes))
    engine._threads.shutdown(wait=True)  # would wait for ever
    late = pool.submit(Task("tiny", b"", None, None))
    until(late.cancelled)
