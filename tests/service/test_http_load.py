"""More work than can be done, and clients that do not wait for it."""

import socket
from collections import Counter
from collections.abc import Callable, Iterator
from concurrent.futures import Future, ThreadPoolExecutor
from contextlib import ExitStack, contextmanager
from pathlib import Path

import httpx
import pytest

from tests.processes import held, until, workers
from tests.service.conftest import Service
from tests.service.metrics import queue, value
from tests.service.test_http_problems import problem_of

PLACES = 2


@pytest.fixture(scope="module")
def narrow(start: Callable[..., Service]) -> Service:
    """One worker, and a queue of few places."""
    return start("--workers", "1", "--max-queue-requests", str(PLACES))


@pytest.fixture(scope="module")
def hasty(start: Callable[..., Service]) -> Service:
    """A second for each request."""
    return start("--deadline-seconds", "1", "--workers", "1")


@pytest.fixture(scope="module")
def tight(start: Callable[..., Service]) -> Service:
    """Room for the bytes of one upload."""
    limits = ["--max-queue-bytes", "30000", "--max-upload-bytes", "30000"]
    return start("--workers", "1", *limits)


@pytest.fixture
def ring(meshes: Path) -> bytes:
    return (meshes / "ring.obj").read_bytes()


def classify(service: Service, content: bytes) -> httpx.Response:
    return httpx.post(f"{service.url}/v1/classify", content=content, timeout=60)


@contextmanager
def connection(service: Service) -> Iterator[socket.socket]:
    with socket.create_connection(address(service), timeout=30) as opened:
        yield opened


def address(service: Service) -> tuple[str, int]:
    host, port = service.url.removeprefix("http://").split(":")
    return host, int(port)


def head(length: int) -> bytes:
    lines = ["POST /v1/classify HTTP/1.1", "Host: localhost", f"Content-Length: {length}"]
    return "\r\n".join([*lines, "", ""]).encode()


@contextmanager
def full(service: Service, content: bytes) -> Iterator[list[Future[httpx.Response]]]:
    """A service that hangs with all its places taken; afterwards it goes on."""
    with ThreadPoolExecutor(PLACES) as pool, held(workers(service.process.pid)):
        answers = [pool.submit(classify, service, content) for _ in range(PLACES)]
        until(lambda: queue(service) == PLACES)
        yield answers


def test_who_finds_no_place_is_told_when_to_come_back(narrow: Service, ring: bytes) -> None:
    with full(narrow, ring) as accepted:
        response = classify(narrow, ring)
        assert problem_of(response, 503)["fault"] == "full"
        assert 1 <= int(response.headers["retry-after"]) <= 30
        assert httpx.get(f"{narrow.url}/readyz").status_code == 200
    assert [answer.result().status_code for answer in accepted] == [200] * PLACES
    assert classify(narrow, ring).status_code == 200


def test_who_leaves_makes_place(narrow: Service, ring: bytes) -> None:
    with ThreadPoolExecutor(PLACES) as pool, held(workers(narrow.process.pid)):
        running = pool.submit(classify, narrow, ring)
        until(lambda: queue(narrow) == 1)
        with connection(narrow) as leaver:
            leaver.sendall(head(len(ring)) + ring)
            until(lambda: queue(narrow) == 2)
            assert classify(narrow, ring).status_code == 503
        until(lambda: queue(narrow) == 1)
        stays = pool.submit(classify, narrow, ring)
        until(lambda: queue(narrow) == 2)
    assert [running.result().status_code, stays.result().status_code] == [200, 200]


def test_an_upload_that_dawdles_ends_at_the_deadline(hasty: Service) -> None:
    with connection(hasty) as slow:
        slow.sendall(head(20_000) + b"v 0 0 0\n")
        answer = b"".join(iter(lambda: slow.recv(4096), b""))  # until it is closed
        assert answer.startswith(b"HTTP/1.1 408 ")
        assert b'"fault":"upload-too-slow"' in answer
    assert "Traceback" not in hasty.log.read_text()


@pytest.mark.parametrize("sent", [b"", b"GET /livez HTTP/1.1\r\nHost: localhost\r\n"])
def test_a_request_that_never_comes_ends_the_connection(hasty: Service, sent: bytes) -> None:
    with connection(hasty) as slow:
        slow.sendall(sent)
        assert slow.recv(4096) == b""


def test_headers_without_end_are_refused(hasty: Service) -> None:
    with connection(hasty) as opened:
        endless = b"GET /livez HTTP/1.1\r\n" + (b"X-Padding: " + b"x" * 1000 + b"\r\n") * 5000
        with pytest.raises(ConnectionError):
            opened.sendall(endless)


def test_bytes_that_uploads_hold_are_bounded(tight: Service, ring: bytes) -> None:
    assert 5_000 < len(ring) < 30_000
    with connection(tight) as slow:
        slow.sendall(head(30_000) + b"#" * 25_000)
        until(lambda: value(tight, "queue_bytes") == 25_000)
        problem = problem_of(classify(tight, ring), 503)
        assert "bytes of uploads" in problem["detail"]
    until(lambda: value(tight, "queue_bytes") == 0)
    assert classify(tight, ring).status_code == 200


def test_an_upload_that_declares_much_and_sends_little_keeps_no_room(
    tight: Service, ring: bytes
) -> None:
    with connection(tight) as slow:
        slow.sendall(head(30_000) + ring[:100])
        until(lambda: value(tight, "queue_bytes") == 100)
        until(lambda: classify(tight, ring).status_code == 200)
        slow.sendall(ring[100:] + b"#" * (30_000 - len(ring)))  # it goes on where there is room
        assert slow.recv(4096).startswith(b"HTTP/1.1 200 ")


def test_of_many_large_uploads_at_once_those_that_fit_are_taken(
    start: Callable[..., Service], ring: bytes
) -> None:
    """What they declare is reserved as they begin, and what a refused one held is free at once."""
    size, fitting, more = 50_000, 10, 4
    limits = ["--max-queue-bytes", str(fitting * size + size // 2)]
    service = start("--workers", "1", *limits, "--max-upload-bytes", str(size))
    content = ring + b"#" * (size - len(ring))
    with ExitStack() as stack:
        opened = [stack.enter_context(connection(service)) for _ in range(fitting + more)]
        for each in opened:
            each.sendall(head(size) + content[: size // 2])
        until(lambda: value(service, "queue_bytes") == fitting * (size // 2))
        for each in opened:
            each.sendall(content[size // 2 :])
        statuses = Counter(each.recv(4096).split(b" ", 2)[1] for each in opened)
    assert statuses == {b"200": fitting, b"503": more}
