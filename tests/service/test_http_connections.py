"""What the server does not take is told as every error is, counted and logged; no connection is
held for who does not go on."""

import asyncio
import json
import socket
import time
from collections.abc import Callable
from contextlib import ExitStack, suppress
from pathlib import Path

import httpx
import pytest
import uvicorn
from starlette.types import Receive, Scope, Send
from uvicorn.protocols.http.httptools_impl import HttpToolsProtocol
from uvicorn.server import ServerState

from meshconv3d.service.http.admission import Admission
from meshconv3d.service.http.connections import CROWD, MAX_HEAD_BYTES, bounded_connection
from tests.processes import until
from tests.service.conftest import Service
from tests.service.metrics import metrics
from tests.service.test_http_load import address, connection, head

MOST = 4
TLS_HELLO = bytes.fromhex("160301020001")
CHUNKED = b"POST %s HTTP/1.1\r\nHost: localhost\r\nTransfer-Encoding: chunked\r\n\r\n"
CLASSIFY, LIVE = b"/v1/classify", b"/livez"
LIVE_REQUEST = b"GET /livez HTTP/1.1\r\nHost: localhost\r\n\r\n"


@pytest.fixture(scope="module")
def few(start: Callable[..., Service]) -> Service:
    """Few connections, and three seconds for each request."""
    limits = ["--max-connections", str(MOST), "--deadline-seconds", "3"]
    return start("--workers", "1", *limits)


def told(connection: socket.socket) -> list[tuple[int, dict[str, str], dict]]:
    """Every answer up to the end of the connection: status, headers, document."""
    read, answers = b"", []
    while data := connection.recv(65536):
        read += data
    while read:
        lines, _, read = read.partition(b"\r\n\r\n")
        status, *fields = lines.decode().split("\r\n")
        headers = {name.lower(): value for name, value in (f.split(": ", 1) for f in fields)}
        length = int(headers["content-length"])
        answers.append((int(status.split()[1]), headers, json.loads(read[:length])))
        read = read[length:]
    return answers


def refused(answer: tuple[int, dict[str, str], dict], status: int, fault: str) -> dict[str, str]:
    """That it is the problem document of a refusal; its headers."""
    found, headers, document = answer
    assert (found, document["status"], document["fault"]) == (status, status, fault)
    assert headers["content-type"] == "application/problem+json"
    assert headers["x-request-id"] == document["request_id"]
    assert headers["x-content-type-options"] == "nosniff"
    assert headers["connection"] == "close"
    assert len(document["detail"]) > 10
    return headers


def count(service: Service, **labels: str) -> float:
    """Requests of such labels, once connections that were closed are gone."""
    until(lambda: httpx.get(f"{service.url}/metrics").status_code == 200)
    return sum(
        found
        for (name, has), found in metrics(service).items()
        if name == "meshconv3d_requests_total" and labels.items() <= has
    )


@pytest.mark.parametrize(
    "sent",
    [
        TLS_HELLO,
        b"what is this?\r\n\r\n",
        b"GET / HTTP/1.1\r\nno header\r\n\r\n",
        b"GET http://[ HTTP/1.1\r\n\r\n",
        "GET /ü HTTP/1.1\r\nHost: localhost\r\n\r\n".encode(),
        b"POST / HTTP/1.1\r\nContent-Length: 1\r\nContent-Length: 2\r\n\r\n",
        b"POST / HTTP/1.1\r\nContent-Length: 1\r\nTransfer-Encoding: chunked\r\n\r\n",
        b"POST / HTTP/1.1\r\nContent-Length: -1\r\n\r\n",
    ],
)
def test_what_is_no_http(few: Service, sent: bytes) -> None:
    before = count(few, route="none", status="400", fault="bad-http")
    with connection(few) as opened:
        opened.sendall(sent)
        [answer] = told(opened)
    headers = refused(answer, 400, "bad-http")
    until(lambda: count(few, route="none", status="400", fault="bad-http") == before + 1)
    until(lambda: headers["x-request-id"] in few.log.read_text())
    (line,) = (x for x in few.log.read_text().splitlines() if headers["x-request-id"] in x)
    assert json.loads(line)["fault"] == "bad-http"


@pytest.mark.parametrize(
    "body",
    [
        b"no number\r\n",
        b"5\r\nabc",
        b"3\r\nabcdef\r\n",
        b"-1\r\n",
        b"0\r\n" + b"trailer: a\r\n" * (MAX_HEAD_BYTES // 12 + 1),
    ],
)
def test_a_body_that_breaks(few: Service, body: bytes) -> None:
    with connection(few) as opened:
        opened.sendall(CHUNKED % CLASSIFY + body)
        time.sleep(0.05)
        with suppress(ConnectionError):
            opened.sendall(b"\r\nneither this\r\n")
        answer = b"".join(iter(lambda: opened.recv(65536), b""))  # until it is closed
    assert answer.startswith(b"HTTP/1.1 400 ")
    until(lambda: count(few, route="/v1/classify", fault="client-gone"))


def test_a_body_that_breaks_and_is_not_asked_for(few: Service) -> None:
    with connection(few) as opened:  # after it was answered
        opened.sendall((CHUNKED % LIVE).replace(b"POST", b"GET"))
        answer = b""
        while not answer.endswith(b"}"):  # head and body may come apart
            answer += opened.recv(65536)
        assert answer.startswith(b"HTTP/1.1 200 ")
        opened.sendall(b"no number\r\n")
        [refusal] = told(opened)
    refused(refusal, 400, "bad-http")


@pytest.mark.parametrize("second", [LIVE_REQUEST * 3, b"nothing of this\r\n\r\n"])
def test_a_request_that_does_not_wait_for_the_answer_before(few: Service, second: bytes) -> None:
    """The connection ends after the first answer, and the client asks again."""
    with connection(few) as opened:
        with suppress(ConnectionError):
            opened.sendall(LIVE_REQUEST + second)
        [(status, headers, _)] = told(opened)
    assert (status, headers["connection"]) == (200, "close")


def test_a_body_after_another_protocol_was_asked_for(few: Service) -> None:
    """As `curl --http2` does; without a body, the wish is passed over."""
    upgrade = b"Connection: Upgrade\r\nUpgrade: h2c\r\n\r\n"
    with connection(few) as opened:
        opened.sendall(head(2).removesuffix(b"\r\n") + upgrade + b"ab")
        [answer] = told(opened)
    refused(answer, 400, "upgrade-with-body")
    with connection(few) as opened:
        opened.sendall(LIVE_REQUEST.removesuffix(b"\r\n") + upgrade)
        assert opened.recv(65536).startswith(b"HTTP/1.1 200 ")


def test_headers_without_end(few: Service) -> None:
    begun = b"GET /livez HTTP/1.1\r\nX-Padding: "
    with connection(few) as opened:
        opened.sendall(begun + b"x" * (MAX_HEAD_BYTES + 1 - len(begun)))
        [answer] = told(opened)
    refused(answer, 431, "head-too-long")
    assert answer[2]["limit"] == MAX_HEAD_BYTES
    assert count(few, route="none", status="431", fault="head-too-long") == 1


def test_headers_that_are_too_long_but_come_at_once(few: Service) -> None:
    begun = LIVE_REQUEST.removesuffix(b"\r\n")
    one = b"X-Padding: " + b"x" * MAX_HEAD_BYTES + b"\r\n"
    many = b"a:b\r\n" * (MAX_HEAD_BYTES // 4)  # more would be reset, not answered
    for long in (one, many):
        with connection(few) as opened:
            opened.sendall(begun + long + b"\r\n")
            [answer] = told(opened)
        refused(answer, 431, "head-too-long")


def test_more_connections_than_are_served(few: Service) -> None:
    """Each is told so and closed, but for probes; and when others have left, it is served."""
    before = count(few, status="503", fault="full", route="/v1/limits")
    with ExitStack() as stack:
        for _ in range(MOST):
            stack.enter_context(connection(few)).sendall(LIVE_REQUEST)
        with connection(few) as late:
            late.sendall(b"GET /v1/limits HTTP/1.1\r\nHost: localhost\r\n\r\n")
            [answer] = told(late)
        headers = refused(answer, 503, "full")
        assert int(headers["retry-after"]) >= 1
        with connection(few) as probe:
            probe.sendall(LIVE_REQUEST)
            [(status, headers, _)] = told(probe)
            assert (status, headers["connection"]) == (200, "close")
    until(lambda: httpx.get(f"{few.url}/v1/limits").status_code == 200)
    assert count(few, status="503", fault="full", route="/v1/limits") > before


def test_no_more_are_opened_than_can_be_told(few: Service) -> None:
    """Those beyond are closed; those that came before go on."""
    with ExitStack() as stack:
        crowd = [stack.enter_context(connection(few)) for _ in range(MOST + CROWD + 10)]
        assert crowd[-1].recv(1) == b""
        crowd[0].sendall(LIVE_REQUEST)
        assert crowd[0].recv(1) == b"H"
    until(lambda: httpx.get(f"{few.url}/v1/limits").status_code == 200)


def test_who_takes_no_answer_is_not_waited_for(few: Service) -> None:
    """The connection is dropped long before an idle one is."""
    before = open_files(few)
    with socket.socket() as opened:
        opened.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 4096)
        opened.connect(address(few))
        opened.sendall(b"GET /v1/samples/train.stl HTTP/1.1\r\nHost: localhost\r\n\r\n")
        until(lambda: open_files(few) > before)
        until(lambda: open_files(few) <= before)
    assert "Traceback" not in few.log.read_text()


def open_files(service: Service) -> int:
    return len(list(Path(f"/proc/{service.process.pid}/fd").iterdir()))


def test_who_leaves_with_several_requests_under_way(few: Service) -> None:
    with connection(few) as opened:
        opened.sendall((head(2) + b"ab") * 3)
    until(lambda: httpx.get(f"{few.url}/v1/limits").status_code == 200)
    assert "Traceback" not in few.log.read_text()


class Transport(asyncio.Transport):
    """Takes what is written, to nowhere."""

    def is_closing(self) -> bool:
        return False

    def write(self, data: object) -> None:
        pass

    def pause_reading(self) -> None:
        pass

    def resume_reading(self) -> None:
        pass


@pytest.mark.parametrize("size", [1, 7, 300])
def test_small_chunks_are_handed_over_together(monkeypatch: pytest.MonkeyPatch, size: int) -> None:
    """uvicorn copies all that waits for each part that it is handed."""
    handed = []

    async def app(scope: Scope, receive: Receive, send: Send) -> None:
        await asyncio.Event().wait()

    async def receive_chunks() -> None:
        config = uvicorn.Config(app, lifespan="off", log_config=None)
        config.load()
        bounded = bounded_connection(30.0, 2, Admission(1, 1, 1.0, 1))
        connection = bounded(config=config, server_state=ServerState(), app_state={})
        connection.connection_made(Transport())
        connection.data_received(CHUNKED % b"/")
        monkeypatch.setattr(HttpToolsProtocol, "on_body", lambda _, body: handed.append(body))
        connection.data_received((b"%x\r\n" % size + b"#" * size + b"\r\n") * 20_000)

    asyncio.run(receive_chunks())
    sent = 20_000 * size
    assert b"".join(handed) == b"#" * sent
    assert len(handed) <= 1 + 20_000 * (size + 7) // MAX_HEAD_BYTES
