"""The log of a running service: one line for each request, and nothing that is secret."""

import hashlib
import json
import re
from collections.abc import Callable
from pathlib import Path

import httpx
import pytest

from tests.processes import until
from tests.service.conftest import Service

TRACE = "0af7651916cd43dd8448eb211c80319c"
CALLER = "b7ad6b7169203331"


@pytest.fixture(scope="module")
def logged(start: Callable[..., Service]) -> Service:
    """A service that these tests alone ask."""
    return start("--workers", "1")


def line_of(service: Service, response: httpx.Response) -> dict:
    """What the log says of one request; it is written just after the answer."""
    name = response.headers["x-request-id"]
    until(lambda: name in service.log.read_text())
    (line,) = (line for line in service.log.read_text().splitlines() if name in line)
    return json.loads(line)


def test_a_request_is_one_line(logged: Service, meshes: Path) -> None:
    ring = (meshes / "ring.obj").read_bytes()
    line = line_of(logged, httpx.post(f"{logged.url}/v1/classify", content=ring))
    assert line["message"].startswith("POST /v1/classify 200 in ")
    assert (line["method"], line["route"], line["status"]) == ("POST", "/v1/classify", 200)
    assert line["fault"] is None
    assert line["bytes"] == len(ring)
    assert line["sha256"] == [hashlib.sha256(ring).hexdigest()[:16]]
    assert line["duration_ms"] > 0
    assert line["level"] == "INFO"
    assert line["timestamp"]


def test_a_refusal_says_why(logged: Service) -> None:
    line = line_of(logged, httpx.post(f"{logged.url}/v1/classify", content=b"v 0 0 0\n"))
    assert (line["status"], line["fault"]) == (422, "no-faces")
    assert "422 no-faces" in line["message"]


def test_the_hash_is_that_of_the_file_not_of_the_form(logged: Service) -> None:
    large = b"#" * 2_000_000  # hashed elsewhere, not to keep others waiting
    files = [("file", (f"{i}.obj", content)) for i, content in enumerate((b"v 0 0 0\n", large))]
    line = line_of(logged, httpx.post(f"{logged.url}/v1/classify/batch", files=files, timeout=60))
    assert line["sha256"] == [hashlib.sha256(content).hexdigest()[:16] for _, (_, content) in files]


def test_neither_contents_nor_names_are_logged(logged: Service) -> None:
    secret = "Xylophone"
    stl = f"solid {secret}\nfacet normal {secret}\n".encode()
    for content in (stl, f"v 0 {secret} 0\nf 1 1 1\n".encode()):
        files = {"file": (f"{secret}.obj", content)}
        httpx.post(f"{logged.url}/v1/classify", files=files)
        httpx.post(f"{logged.url}/v1/classify/batch", files=files)
        httpx.post(f"{logged.url}/v1/classify?model={secret}", content=content)
    httpx.get(f"{logged.url}/{secret}?{secret}", headers={secret: secret})
    line_of(logged, httpx.get(f"{logged.url}/livez"))
    assert secret not in logged.log.read_text()


@pytest.mark.parametrize("version", ["00", "01", "fe"])
def test_a_trace_is_gone_on_with(logged: Service, version: str) -> None:
    more = "" if version == "00" else "-what-later-versions-add"
    given = {"traceparent": f"{version}-{TRACE}-{CALLER}-01{more}"}
    response = httpx.get(f"{logged.url}/livez", headers=given)
    answered = re.fullmatch(rf"00-{TRACE}-([0-9a-f]{{16}})-01", response.headers["traceparent"])
    assert answered
    line = line_of(logged, response)
    assert (line["trace_id"], line["span_id"]) == (TRACE, answered[1])
    assert answered[1] != CALLER


@pytest.mark.parametrize(
    "given",
    [
        [],
        [f"00-{'0' * 32}-{CALLER}-01"],
        [f"00-{TRACE}-{'0' * 16}-01"],
        [f"ff-{TRACE}-{CALLER}-01"],
        [f"00-{TRACE}-{CALLER}-01-more"],
        [f"00-{TRACE.upper()}-{CALLER}-01"],
        [f"00-{TRACE}-{CALLER}-01\tx"],
        ["no trace"],
        [f"00-{TRACE}-{CALLER}-01"] * 2,
    ],
)
def test_else_a_trace_begins(logged: Service, given: list[str]) -> None:
    headers = [("traceparent", value) for value in given]
    response = httpx.get(f"{logged.url}/livez", headers=headers)
    answered = re.fullmatch("00-([0-9a-f]{32})-[0-9a-f]{16}-00", response.headers["traceparent"])
    assert answered
    assert answered[1] != TRACE


def test_every_line_is_json_from_start_to_stop(start: Callable[..., Service]) -> None:
    service = start("--workers", "1")
    assert service.stop() == 0
    lines = [json.loads(line) for line in service.log.read_text().splitlines()]
    messages = [line["message"] for line in lines]
    assert "serving tiny with 1 workers" in messages
    assert messages[-1] == "stopped"


def test_plain_text_for_people(start: Callable[..., Service]) -> None:
    service = start("--workers", "1", "--log-format", "text")
    response = httpx.get(f"{service.url}/v1/nothing")
    assert response.status_code == 404
    assert service.stop() == 0
    assert re.search(r"INFO GET none 404 not-found in \d+\.\d ms$", service.log.read_text(), re.M)
