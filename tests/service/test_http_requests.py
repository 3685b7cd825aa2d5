"""Nothing that a client puts into a request stops the service, or takes memory without bound.

While each request is sent, /livez is asked again and again: what the process computes from one
such question to its answer is what the event loop spends on others meanwhile. That is CPU time, so
that it is the same on a busy machine.
"""

import socket
import threading
from collections.abc import Callable, Iterator
from contextlib import suppress
from functools import cache
from pathlib import Path

import httpx
import pytest

from benchmarks.processes import computed_by
from tests.model.loading.loading_builders import archive
from tests.service.conftest import Service
from tests.service.test_http_load import address

# Some turns of the loop, with what other connections do in each; a decoder that an attack finds
# takes minutes.
MOST_SECONDS = 0.25
MOST_BYTES = 96 * 2**20
MANY = 300_000

FORM = 'multipart/form-data; boundary="b"'
PART = b'--b\r\nContent-Disposition: form-data; name="file"; filename="a.obj"'
FIELD = b'--b\r\nContent-Disposition: form-data; name="note"\r\n\r\n'
END = b"\r\n--b--\r\n"


def form(*parts: bytes, media_type: str = FORM) -> bytes:
    return request(b"\r\n".join(parts) + END, "/v1/classify/batch", f"content-type: {media_type}")


def infer(body: bytes, json_length: int | None = None) -> bytes:
    length = [] if json_length is None else [f"inference-header-content-length: {json_length}"]
    return request(body, "/v2/models/tiny/infer", *length)


def tensor(**changes: str) -> bytes:
    fields = {"name": '"mesh"', "datatype": '"BYTES"', "shape": "[1]", "data": '["v"]'} | changes
    entry = ",".join(f'"{name}":{value}' for name, value in fields.items())
    return infer(f'{{"inputs":[{{{entry}}}]}}'.encode())


def request(body: bytes, path: str = "/v1/classify", *headers: str) -> bytes:
    return head(f"POST {path}", f"content-length: {len(body)}", *headers) + body


def head(line: str, *headers: str) -> bytes:
    lines = [f"{line} HTTP/1.1", "host: localhost", "connection: close", *headers, "", ""]
    return "\r\n".join(lines).encode("latin-1")


def binary(count: int, elements: bytes) -> bytes:
    fields = '"name":"mesh","datatype":"BYTES"'
    size = f'"parameters":{{"binary_data_size":{len(elements)}}}'
    start = f'{{"inputs":[{{{fields},"shape":[{count}],{size}}}]}}'.encode()
    return infer(start + elements, len(start))


@cache
def full_archive() -> bytes:
    return archive({f"{number}.txt": "" for number in range(9_999)})


REQUESTS: dict[str, Callable[[], bytes]] = {
    **{
        f"a form in {charset}": lambda charset=charset: form(
            *[FIELD + b"a" * 400_000 + b"-"] * 9, media_type=f"{FORM}; charset={charset}"
        )
        for charset in ("punycode", "utf-7", "unicode_escape", "idna")
    },
    "a part in punycode": lambda: form(
        *[FIELD.strip() + b"\r\nContent-Type: text/plain; charset=punycode\r\n\r\n" + b"a" * MANY]
        * 9
    ),
    "many files": lambda: form(*[PART + b"\r\n\r\nv"] * 50_000),
    "many fields": lambda: form(*[FIELD] * 50_000),
    "headers of a part": lambda: form(PART + b"\r\nA: b" * MANY + b"\r\n\r\nv"),
    "blanks in headers": lambda: form(*[PART + b"\r\nA:" + b" " * 2000 + b"b\r\n\r\nv"] * 60),
    "parameters of a part": lambda: form(*[PART + b";a=" * 600 + b"\r\n\r\nv"] * 60),
    "an encoded name": lambda: form(PART + b"; filename*=utf-8''" + b"%ff" * MANY + b"\r\n\r\nv"),
    "what precedes a form": lambda: form(b"\r\n" * 2_000_000, PART + b"\r\n\r\nv"),
    "almost a boundary": lambda: form(PART + b"\r\n\r\n" + b"\r\n--" * 1_000_000),
    "parameters of a form": lambda: form(PART, media_type=FORM + ";" * 15_000),
    "a long boundary": lambda: form(PART, media_type=FORM.replace("b", "b" * 10_000)),
    "archives of many files": lambda: form(
        *[PART.replace(b"obj", b"zip") + b"\r\n\r\n" + full_archive()] * 8
    ),
    "meshes that name many files": lambda: form(
        *[PART + b"\r\n\r\n{" + b'"uri":"a.bin",' * MANY] * 20
    ),
    "a body in chunks of a byte": lambda: (
        head("POST /v1/classify", "transfer-encoding: chunked")
        + b"1\r\n#\r\n" * MANY
        + b"0\r\n\r\n"
    ),
    "wrong parameters": lambda: tensor(
        parameters="{" + ",".join(f'"k{i}":[]' for i in range(MANY)) + "}"
    ),
    "many elements": lambda: tensor(data="[" + '"a",' * MANY + '"a"]'),
    "elements that hide their quotes": lambda: tensor(data="[" + r'"\\",' * MANY + '"a"]'),
    "a long shape": lambda: tensor(shape="[" + "1," * 10**6 + "1]"),
    "a long number": lambda: tensor(shape="[1" + "0" * 10**6 + "]"),
    "a long fraction": lambda: tensor(other="1." + "1" * 10**6),
    "deep nesting": lambda: tensor(other="[" * 10**6),
    "many inputs": lambda: infer(
        b'{"inputs":[' + b'{"name":"","shape":[1],"datatype":""},' * 50_000
    ),
    "a string of escapes": lambda: tensor(data='["' + r"\n" * 2 * 10**6 + '"]'),
    "many binary elements": lambda: binary(64, bytes(4_000_000)),
    "long binary elements": lambda: binary(64, (b"\0\0\x0f\0" + bytes(0xF0000)) * 64),
    "a long name": lambda: infer(
        b'{"inputs":[{"name":"mesh","shape":[1],"datatype":"BYTES","data":["v"]},'
        b'{"name":"name","shape":[1],"datatype":"BYTES","data":["%s"]}]}' % (b"a/" * 2_000_000)
    ),
    "a long query": lambda: request(b"v", "/v1/classify?" + "&a=%20" * 2_500),
    "a long Accept": lambda: request(b"v", "/v1/explain", "accept: " + "a/b;q=0," * 1_900),
    "commas in Accept": lambda: request(b"v", "/v1/explain", "accept: " + "," * 15_000),
    "many ranges": lambda: head(
        "GET /v1/samples/boat.obj", "range: bytes=" + ",".join(f"{i}-" for i in range(2_500))
    ),
    "many cookies": lambda: head("GET /v1/models", *["cookie: a=b"] * 1_000),
    "a long trace": lambda: head("GET /v1/models", "traceparent: 00-" + "a" * 15_000),
    "many headers": lambda: head("GET /v1/models", *["a: b"] * MANY),
    "requests at once": lambda: head("GET /v1/models").replace(b"close", b"keep-alive") * 20_000,
}


@pytest.fixture(scope="module")
def service(start: Callable[..., Service]) -> Service:
    return start("--workers", "1")


@pytest.mark.parametrize("name", REQUESTS)
def test_a_request_neither_stops_the_service_nor_fills_its_memory(
    service: Service, name: str
) -> None:
    content = REQUESTS[name]()
    before = memory(service, "VmRSS")
    Path(f"/proc/{service.process.pid}/clear_refs").write_text("5")  # forget the peak
    with watched(service) as spent:
        answer = send(service, content)
    assert int(answer.split(b" ", 2)[1]) < 500
    assert len(spent) > 1
    assert max(spent) < MOST_SECONDS
    assert memory(service, "VmHWM") - before < MOST_BYTES
    assert "Traceback" not in service.log.read_text()


class watched:
    """Asks /livez until the block ends; collects what the service computed during each."""

    def __init__(self, service: Service) -> None:
        self._service = service
        self._spent: list[float] = []
        self._over = threading.Event()
        self._thread = threading.Thread(target=self._ask)

    def __enter__(self) -> list[float]:
        self._thread.start()
        return self._spent

    def __exit__(self, *_: object) -> None:
        self._over.set()
        self._thread.join()

    def _ask(self) -> None:
        with httpx.Client(base_url=self._service.url, timeout=60) as client:
            while not self._over.is_set() or len(self._spent) < 2:
                before = computed_by(self._service.process.pid)
                assert client.get("/livez").status_code == 200
                self._spent.append(computed_by(self._service.process.pid) - before)


def send(service: Service, content: bytes) -> bytes:
    """The answer to a request, which may come before all of it is sent."""
    with socket.create_connection(address(service), timeout=60) as opened:
        with suppress(ConnectionError):
            opened.sendall(content)
        return b"".join(received(opened))


def received(opened: socket.socket) -> Iterator[bytes]:
    with suppress(ConnectionError):
        while data := opened.recv(65536):
            yield data


def memory(service: Service, field: str) -> int:
    """Bytes of memory of the front, as the system counts them."""
    status = Path(f"/proc/{service.process.pid}/status").read_text()
    (line,) = (line for line in status.splitlines() if line.startswith(field))
    return int(line.split()[1]) * 1024
