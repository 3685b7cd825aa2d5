"""POST /v1/classify/batch on a running service: several files, a line for each, in order."""

import asyncio
import json
import traceback
from collections.abc import Callable, MutableMapping
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

import anyio
import httpx
import pytest
from starlette.requests import Request

from meshconv3d.model.errors import UnusableMesh
from meshconv3d.model.loading import Limits
from meshconv3d.service.http.admission import Admission
from meshconv3d.service.http.app import create_app
from meshconv3d.service.settings import Settings
from meshconv3d.service.workers import Job, Setup, Task, WorkerPool
from tests.articulated import sample_paths
from tests.processes import held, until, workers
from tests.results import model_info, prediction
from tests.service.conftest import Service
from tests.service.metrics import queue, value
from tests.service.test_http_problems import problem_of

MOST = 3


@pytest.fixture(scope="module")
def narrow(start: Callable[..., Service]) -> Service:
    """One worker, and few meshes in a request."""
    return start("--workers", "1", "--max-batch-meshes", str(MOST), "--deadline-seconds", "4")


@pytest.fixture(scope="module")
def patient(start: Callable[..., Service]) -> Service:
    """One worker with places for three meshes, and time for them."""
    return start("--workers", "1", "--max-queue-requests", "3", "--deadline-seconds", "300")


def form(*files: tuple[str, bytes]) -> list:
    return [("file", file) for file in files]


def lines_of(response: httpx.Response) -> list[dict]:
    assert response.status_code == 200, response.text
    assert response.headers["content-type"] == "application/x-ndjson"
    return [json.loads(line) for line in response.text.splitlines()]


def test_lines_are_the_records_of_the_files_in_order(client: httpx.Client) -> None:
    paths = sorted(sample_paths().values(), key=lambda path: path.stat().st_size)[:4] * 2
    files = form(*((path.name, path.read_bytes()) for path in paths))
    lines = lines_of(client.post("/v1/classify/batch", files=files))
    alone = {
        path.name: client.post("/v1/classify", files=[file]).json()
        for path, file in zip(paths, files, strict=True)
    }
    assert [line["file"] for line in lines] == [path.name for path in paths]
    for line in lines:
        assert line | {"timings_ms": 0} == alone[line["file"]] | {"timings_ms": 0}


def test_a_bad_file_costs_its_own_line(client: httpx.Client, meshes: Path) -> None:
    ring = (meshes / "ring.obj").read_bytes()
    files = form(("a.obj", ring), ("b.obj", b"v 0 0 0\n"), ("c.stl", ring), ("d.obj", ring))
    first, *refused, last = lines_of(client.post("/v1/classify/batch?top=1", files=files))
    assert (first["file"], last["file"]) == ("a.obj", "d.obj")
    assert len(last["scores"]) == 1
    faults = [(line["file"], line["error"]["fault"]) for line in refused]
    assert faults == [("b.obj", "no-faces"), ("c.stl", "format-mismatch")]


def test_a_batch_of_one(client: httpx.Client, meshes: Path) -> None:
    ring = (meshes / "ring.obj").read_bytes()
    (line,) = lines_of(client.post("/v1/classify/batch", files=form(("ring.obj", ring))))
    assert line["mesh"]["faces_in"] == 500


def test_what_is_no_batch(client: httpx.Client) -> None:
    url = "/v1/classify/batch"
    raw = client.post(url, content=b"v 0 0 0", headers={"content-type": "model/obj"})
    assert problem_of(raw, 415)["fault"] == "unknown-media-type"
    other = client.post(url, files={"mesh": ("a.obj", b"v 0 0 0")})
    assert problem_of(other, 400)["fault"] == "no-file-field"
    missing = client.post(f"{url}?model=other", files=form(("a.obj", b"v")))
    assert problem_of(missing, 404)["fault"] == "not-found"


def test_files_are_bounded(narrow: Service, meshes: Path) -> None:
    ring = (meshes / "ring.obj").read_bytes()
    url = f"{narrow.url}/v1/classify/batch"
    assert len(lines_of(httpx.post(url, files=form(*[("a.obj", ring)] * MOST)))) == MOST
    for count in (MOST + 1, 40):
        problem = problem_of(httpx.post(url, files=form(*[("a.obj", ring)] * count)), 413)
        assert (problem["fault"], problem["limit"]) == ("too-many-meshes", MOST)


def test_a_batch_that_finds_no_place_is_refused_whole(patient: Service, meshes: Path) -> None:
    ring, service = (meshes / "ring.obj").read_bytes(), patient
    with ThreadPoolExecutor() as pool, held(workers(service.process.pid)):
        alone = pool.submit(httpx.post, f"{service.url}/v1/classify", content=ring, timeout=60)
        until(lambda: queue(service) == 1)
        files = form(*[("a.obj", ring)] * 3)
        refused = httpx.post(f"{service.url}/v1/classify/batch", files=files, timeout=60)
        assert problem_of(refused, 503)["fault"] == "full"
        assert int(refused.headers["retry-after"]) >= 1
        assert queue(service) == 1
    assert alone.result().status_code == 200


class PatientPool(WorkerPool):
    """A pool of no workers, whose answers the test gives."""

    def __init__(self) -> None:
        super().__init__(Setup((), Limits(), memory_bytes=0, seconds=1.0), workers=0)
        self.models = {"any": model_info()}
        self.jobs: list[Job] = []

    def submit(self, task: Task, expires: float | None = None) -> Job:
        self.jobs.append(Job(task, expires))
        return self.jobs[-1]


class Played:
    """A batch of three meshes whose results, and whose client, the test plays."""

    def __init__(self) -> None:
        self.pool = PatientPool()
        self.app = create_app(self.pool, Admission(9, 9999, 9.0, workers=1), Settings())
        self.request = httpx.Request(
            "POST", "http://localhost/v1/classify/batch", files=form(*[("a.obj", b"v")] * 3)
        )
        self.leaves = asyncio.Event()
        self.sent: list[bytes] = []
        self._asked = False

    async def run(self) -> None:
        headers = [(name.lower(), value) for name, value in self.request.headers.raw]
        scope = {"type": "http", "method": "POST", "path": self.request.url.path}
        scope |= {"query_string": b"", "headers": headers}
        await self.app(scope, self._receive, self._send)

    async def begun(self) -> None:
        while len(self.pool.jobs) < 3:
            await anyio.sleep(0.01)

    def finish(self, number: int) -> None:
        self.pool.jobs[number].finish(prediction(number, -1.0))

    async def _receive(self) -> dict:
        if not self._asked:
            self._asked = True
            return {"type": "http.request", "body": self.request.read()}
        await self.leaves.wait()
        return {"type": "http.disconnect"}

    async def _send(self, message: MutableMapping[str, Any]) -> None:
        self.sent.append(message.get("body", b""))


def test_lines_leave_as_soon_as_they_and_those_before_are_done() -> None:
    async def play() -> None:
        played = Played()
        async with anyio.create_task_group() as group:
            group.start_soon(played.run)
            await played.begun()
            for done, expected in ((1, []), (0, [0, 1]), (2, [0, 1, 2])):
                played.finish(done)
                await anyio.sleep(0.6)  # longer than anyone looks away
                lines = map(json.loads, b"".join(played.sent).splitlines())
                assert [line["scores"][0]["score"] for line in lines] == expected

    anyio.run(play)


def test_errors_of_a_batch_keep_nothing_of_it() -> None:
    """What waits for them has the request, and many large files may be damaged."""
    errors = [UnusableMesh("no-faces", "it has no faces") for _ in range(3)]

    async def play() -> None:
        played = Played()
        async with anyio.create_task_group() as group:
            group.start_soon(played.run)
            await played.begun()
            for job, error in zip(played.pool.jobs, errors, strict=True):
                job.finish(error)
        assert b"".join(played.sent).count(b"no-faces") == 3

    anyio.run(play)
    for error in errors:
        passed = [frame for frame, _ in traceback.walk_tb(error.__traceback__)]
        held_by_it = [value for frame in passed for value in frame.f_locals.values()]
        assert not any(isinstance(value, Request | Job) for value in held_by_it)


@pytest.mark.parametrize("running", [False, True])
def test_who_leaves_midway_is_told_apart(caplog: pytest.LogCaptureFixture, running: bool) -> None:
    caplog.set_level("INFO", "meshconv3d.service.http.telemetry")

    async def play() -> None:
        played = Played()
        async with anyio.create_task_group() as group:
            group.start_soon(played.run)
            await played.begun()
            jobs = played.pool.jobs
            played.finish(0)
            if running:
                jobs[1].begin()
            played.leaves.set()
            while not jobs[2].cancelled():
                await anyio.sleep(0.01)
            if running:
                played.finish(1)
            assert jobs[1].cancelled() != running

    anyio.run(play)
    line = caplog.records[-1]
    assert (line.status, line.fault) == (200, "client-gone")  # type: ignore[attr-defined]


def test_the_deadline_is_that_of_the_whole_batch(narrow: Service, meshes: Path) -> None:
    ring = (meshes / "ring.obj").read_bytes()
    files = form(*[("a.obj", ring)] * MOST)
    with held(workers(narrow.process.pid)):
        response = httpx.post(f"{narrow.url}/v1/classify/batch", files=files, timeout=60)
    assert [line["error"]["fault"] for line in lines_of(response)] == ["deadline"] * MOST


def test_who_leaves_takes_back_what_has_not_begun(patient: Service, meshes: Path) -> None:
    """Long before the deadline."""
    ring, service = (meshes / "ring.obj").read_bytes(), patient
    with held(workers(service.process.pid)):
        files = form(*[("a.obj", ring)] * 3)
        with pytest.raises(httpx.ReadTimeout):
            httpx.post(f"{service.url}/v1/classify/batch", files=files, timeout=1)
        until(lambda: queue(service) == 0)
    gone = {"route": "/v1/classify/batch", "status": "200", "fault": "client-gone"}
    until(lambda: value(service, "requests_total", **gone) == 1)
    assert httpx.post(f"{service.url}/v1/classify", content=ring).status_code == 200
    assert "Traceback" not in service.log.read_text()
