"""What a file, or the system, does to a worker costs its own request, and no other."""

import os
import signal
from collections import Counter
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import httpx
import numpy as np
import pytest

from benchmarks.processes import computed_by
from tests.processes import children, held, until, workers
from tests.service.conftest import Service
from tests.service.metrics import queue, value
from tests.service.test_http_problems import problem_of

MEMORY = 64 * 2**20


@pytest.fixture(scope="module")
def hasty(start: Callable[..., Service]) -> Service:
    """One worker, and little time."""
    return start("--workers", "1", "--deadline-seconds", "2")


@pytest.fixture(scope="module")
def small(start: Callable[..., Service]) -> Service:
    """One worker, and little memory."""
    return start("--workers", "1", "--worker-memory-bytes", str(MEMORY))


@pytest.fixture(scope="module")
def one(start: Callable[..., Service]) -> Service:
    """One worker, with room for what takes long."""
    return start("--workers", "1")


@pytest.fixture(scope="module")
def two(start: Callable[..., Service]) -> Service:
    """Two workers."""
    return start("--workers", "2")


@pytest.fixture
def ring(meshes: Path) -> bytes:
    return (meshes / "ring.obj").read_bytes()


def classify(service: Service, content: bytes) -> httpx.Response:
    return httpx.post(f"{service.url}/v1/classify", content=content, timeout=60)


def replaced(service: Service, gone: list[int]) -> None:
    """Wait for as many new workers."""
    until(lambda: set(workers(service.process.pid)).isdisjoint(gone))
    until(lambda: value(service, "workers_alive") == len(gone))


def only_worker(service: Service) -> int:
    """Its one worker, once those that were replaced are gone."""
    until(lambda: len(workers(service.process.pid)) == 1)
    return workers(service.process.pid)[0]


def large_stl(faces: int) -> bytes:
    """Random triangles as a binary STL."""
    records = np.zeros(faces, dtype=[("values", "<f4", 12), ("attribute", "<u2")])
    records["values"] = np.random.default_rng(0).random((faces, 12))
    return bytes(80) + np.uint32(faces).tobytes() + records.tobytes()


def test_a_worker_that_dies_costs_its_own_request(one: Service, ring: bytes) -> None:
    worker = only_worker(one)
    before = computed_by(worker)
    with ThreadPoolExecutor(2) as pool:
        large = pool.submit(classify, one, large_stl(100_000))
        until(lambda: computed_by(worker) > before + 0.1)
        queued = pool.submit(classify, one, ring)
        os.kill(worker, signal.SIGKILL)
        problem = problem_of(large.result(), 422)
        assert problem["fault"] == "worker-crashed"
        assert "signal 9" in problem["detail"]
        assert queued.result().status_code == 200


def test_work_that_a_dying_worker_had_not_begun_is_not_lost(one: Service, ring: bytes) -> None:
    """The service is not ready until another worker is there, which does it."""
    worker = only_worker(one)
    # The fork server is one of the children: none is started meanwhile.
    with ThreadPoolExecutor(1) as pool, held(children(one.process.pid)):
        with held([worker]):
            answer = pool.submit(classify, one, ring)
            until(lambda: queue(one) == 1)
            os.kill(worker, signal.SIGKILL)
        until(lambda: httpx.get(f"{one.url}/readyz").status_code == 503)
    assert answer.result().status_code == 200
    assert httpx.get(f"{one.url}/readyz").status_code == 200


def test_work_is_done_by_another_worker_where_one_is_not_replaced(
    two: Service, ring: bytes
) -> None:
    with held(children(two.process.pid)):
        os.kill(workers(two.process.pid)[0], signal.SIGKILL)
        assert [classify(two, ring).status_code for _ in range(4)] == [200] * 4
    until(lambda: len(workers(two.process.pid)) == 2)


def test_no_worker_at_all_is_told_at_the_deadline(hasty: Service, ring: bytes) -> None:
    before = workers(hasty.process.pid)
    with held(children(hasty.process.pid)):
        os.kill(before[0], signal.SIGKILL)
        for _ in range(2):
            assert problem_of(classify(hasty, ring), 504)["fault"] == "deadline"
        assert queue(hasty) == 0
    replaced(hasty, before)
    assert classify(hasty, ring).status_code == 200


def test_idle_workers_that_die_are_replaced(two: Service, ring: bytes) -> None:
    before = workers(two.process.pid)
    for worker in before:
        os.kill(worker, signal.SIGKILL)
    replaced(two, before)
    assert classify(two, ring).status_code == 200


def test_a_worker_that_hangs_costs_its_own_request(hasty: Service, ring: bytes) -> None:
    before = workers(hasty.process.pid)
    with held(before):
        problem = problem_of(classify(hasty, ring), 504)
    assert problem["fault"] == "deadline"
    replaced(hasty, before)
    assert classify(hasty, ring).status_code == 200


def test_a_file_that_takes_too_much_memory(small: Service, ring: bytes) -> None:
    before = workers(small.process.pid)
    # It fits in, twice, as it is handed over: that it is read is what takes too much.
    problem = problem_of(classify(small, large_stl(400_000)), 422)
    assert problem["fault"] == "too-much-memory"
    assert str(MEMORY) in problem["detail"]
    assert classify(small, ring).status_code == 200
    assert workers(small.process.pid) == before


def test_a_file_that_does_not_fit_into_a_worker_at_all(small: Service, ring: bytes) -> None:
    problem = problem_of(classify(small, b"#" * 90 * 2**20), 422)
    assert problem["fault"] == "too-much-memory"
    assert classify(small, ring).status_code == 200


def test_workers_killed_under_load_lose_only_what_they_held(two: Service, ring: bytes) -> None:
    until(lambda: len(workers(two.process.pid)) == 2)
    with ThreadPoolExecutor(8) as pool:
        answers = [pool.submit(classify, two, ring) for _ in range(120)]
        for number, worker in enumerate(workers(two.process.pid), 1):
            until(lambda enough=20 * number: sum(answer.done() for answer in answers) >= enough)
            os.kill(worker, signal.SIGKILL)
        statuses = Counter(answer.result().status_code for answer in answers)
    assert statuses[200] >= 118
    assert set(statuses) <= {200, 422}


def test_a_file_over_a_limit(start: Callable[..., Service], ring: bytes) -> None:
    problem = problem_of(classify(start("--max-faces", "499"), ring), 413)
    assert (problem["fault"], problem["limit"]) == ("too-many-faces", 499)
