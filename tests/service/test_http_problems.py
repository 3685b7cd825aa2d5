"""Every error over HTTP is a problem document: a status, a stable fault, a way out."""

import socket
from collections.abc import Iterator
from pathlib import Path

import anyio
import httpx
import pytest

from meshconv3d.model.loading import Limits
from meshconv3d.service.http.admission import Admission
from meshconv3d.service.http.app import create_app
from meshconv3d.service.settings import Settings
from meshconv3d.service.workers import Job, Setup, Task, WorkerPool
from meshconv3d.service.workers.tasks import TaskFailed
from tests.results import model_info
from tests.service.conftest import LIMIT, Service

STL = {"content-type": "model/stl"}
NAN_STL = b"solid a\nfacet normal 0 0 1\nouter loop\nvertex 0 0 nan\nvertex 1 0 0\nvertex 0 1 0\n"
MULTIPART = "multipart/form-data; boundary=b"
FORM = b'--b\r\nContent-Disposition: form-data; name="file"; filename="a.obj"\r\n\r\nv\r\n--b--\r\n'
NAN_STL += b"endloop\nendfacet\nendsolid a\n"


def problem_of(response: httpx.Response, status: int) -> dict:
    assert response.status_code == status, response.text
    assert response.headers["content-type"] == "application/problem+json"
    problem = response.json()
    assert problem["status"] == status
    assert problem["request_id"] == response.headers["x-request-id"]
    assert problem["title"]
    assert problem["fault"] == problem["fault"].lower().replace(" ", "-")
    return problem


def test_request_ids_differ(client: httpx.Client) -> None:
    ids = {problem_of(client.get("/nothing"), 404)["request_id"] for _ in range(5)}
    assert len(ids) == 5


@pytest.mark.parametrize(
    ("content", "headers", "status", "fault"),
    [
        (b"", {}, 400, "empty-file"),
        (b"\0" * 10, STL, 400, "truncated"),
        (b"glTF" + b"\xff" * 40, {"content-type": "model/gltf-binary"}, 400, None),
        (b"{nothing", {"content-type": "multipart/form-data"}, 400, "bad-request"),
        (b"{nothing", {"content-type": MULTIPART}, 400, "bad-request"),
        (FORM[:-6], {"content-type": MULTIPART}, 400, "bad-request"),
        (FORM, {"content-type": "multipart/form-data"}, 400, "bad-request"),
        (FORM, {"content-type": f"{MULTIPART}; charset=undefined"}, 415, "unknown-charset"),
        (FORM, {"content-type": f"{MULTIPART}; charset=punycode"}, 415, "unknown-charset"),
        (b"v 0 0 0\n", {"content-type": "text/plain"}, 415, "unknown-media-type"),
        (b"{}", {"content-type": "application/json"}, 415, "unknown-media-type"),
        (b"v 0 0 0\nf 1 1 1\n", STL, 415, "format-mismatch"),
        (b"what is this?", {}, 415, "unknown-format"),
        (b"v 0 0 0\nv 1 0 0\n", {"content-type": "model/obj"}, 422, "no-faces"),
        (b"v 1 1 1\nf 1 1 1\n", {"content-type": "model/obj"}, 422, "zero-extent"),
        (NAN_STL, STL, 422, "non-finite-vertices"),
    ],
)
def test_what_is_wrong_with_a_body(
    client: httpx.Client, content: bytes, headers: dict, status: int, fault: str | None
) -> None:
    problem = problem_of(client.post("/v1/classify", content=content, headers=headers), status)
    assert fault is None or problem["fault"] == fault
    assert len(problem["detail"]) > 10
    assert "limit" not in problem


def test_accepted_types_are_named(client: httpx.Client) -> None:
    headers = {"content-type": "text/plain"}
    detail = client.post("/v1/classify", content=b"x", headers=headers).json()["detail"]
    assert all(name in detail for name in ("'text/plain'", "model/stl", "model/obj", "'file'"))


@pytest.mark.parametrize(
    "form",
    [
        {"files": {"mesh": ("a.obj", b"v 0 0 0")}},
        {"files": {"other": ("a.obj", b"")}, "data": {"file": "v 0 0 0"}},
    ],
)
def test_a_form_without_the_file(client: httpx.Client, form: dict) -> None:
    problem = problem_of(client.post("/v1/classify", **form), 400)
    assert problem["fault"] == "no-file-field"


def test_a_form_with_two_files(client: httpx.Client) -> None:
    files = [("file", ("a.obj", b"v 0 0 0")), ("file", ("b.obj", b"v 0 0 0"))]
    problem = problem_of(client.post("/v1/classify", files=files), 413)
    assert (problem["fault"], problem["limit"]) == ("too-many-meshes", 1)


def test_a_form_whose_name_contradicts_the_content(client: httpx.Client, meshes: Path) -> None:
    content = (meshes / "ring.obj").read_bytes()
    for name, fault in (("ring.stl", "format-mismatch"), ("ring.exe", "unknown-format")):
        response = client.post("/v1/classify", files={"file": (name, content)})
        assert problem_of(response, 415)["fault"] == fault


@pytest.mark.parametrize("top", ["0", "-1", "many", ""])
def test_a_bad_parameter(client: httpx.Client, meshes: Path, top: str) -> None:
    content = (meshes / "ring.obj").read_bytes()
    problem = problem_of(client.post(f"/v1/classify?top={top}", content=content), 400)
    assert "query.top" in problem["detail"]


def too_large(response: httpx.Response) -> None:
    problem = problem_of(response, 413)
    assert problem["fault"] == "body-too-large"
    assert problem["limit"] == LIMIT
    assert str(LIMIT) in problem["detail"]


def test_a_body_over_the_limit(client: httpx.Client) -> None:
    too_large(client.post("/v1/classify", content=b"\0" * (LIMIT + 1), headers=STL))
    too_large(client.post("/v1/classify", files={"file": ("a.stl", b"\0" * LIMIT)}))


def test_a_chunked_body_over_the_limit(client: httpx.Client) -> None:
    def chunks() -> Iterator[bytes]:
        for _ in range(LIMIT // 50_000 + 1):
            yield b"\0" * 50_000

    too_large(client.post("/v1/classify", content=chunks(), headers=STL))


def test_a_body_of_just_the_limit_is_read(client: httpx.Client, meshes: Path) -> None:
    content = (meshes / "ring.obj").read_bytes()
    padded = content + b"#" * (LIMIT - len(content))
    response = client.post("/v1/classify", content=padded)
    assert response.status_code == 200


def test_a_claimed_length_over_the_limit_is_refused_unread(service: Service) -> None:
    host, port = service.url.removeprefix("http://").split(":")
    with socket.create_connection((host, int(port)), timeout=30) as connection:
        head = "POST /v1/classify HTTP/1.1\r\nHost: localhost\r\nContent-Type: model/stl\r\n"
        connection.sendall(f"{head}Content-Length: {10**12}\r\n\r\n".encode())
        assert connection.recv(1000).startswith(b"HTTP/1.1 413 ")


def test_no_such_path_and_no_such_method(client: httpx.Client) -> None:
    assert problem_of(client.get("/v1/nothing"), 404)["fault"] == "not-found"
    response = client.get("/v1/classify")
    assert problem_of(response, 405)["fault"] == "method-not-allowed"
    assert response.headers["allow"] == "POST"


class FailingPool(WorkerPool):
    """A pool of no workers, whose work fails in a way that nobody foresaw."""

    def __init__(self) -> None:
        setup = Setup((), Limits(), memory_bytes=0, seconds=1.0)
        super().__init__(setup, workers=0)
        self.models = {"any": model_info()}

    def submit(self, task: Task, expires: float | None = None) -> Job:
        job = Job(task, expires)
        job.finish(TaskFailed("at a secret place"))
        return job


def test_an_unforeseen_failure_hides_its_reason_and_names_the_request() -> None:
    app = create_app(FailingPool(), Admission(9, 9999, 9.0, workers=1), Settings())
    transport = httpx.ASGITransport(app, raise_app_exceptions=False)

    async def ask() -> httpx.Response:
        async with httpx.AsyncClient(transport=transport, base_url="http://localhost") as client:
            return await client.post("/v1/classify", content=b"v 0 0 0")

    response = anyio.run(ask)
    problem = problem_of(response, 500)
    assert problem["fault"] == "internal"
    assert "secret" not in response.text
