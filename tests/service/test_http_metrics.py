"""GET /metrics on a running service: what was done is counted, in few series."""

import os
import re
import signal
from collections.abc import Callable

import httpx
import pytest

from meshconv3d.model.loading import Limits
from meshconv3d.service.http.admission import Admission
from meshconv3d.service.http.telemetry import Metrics
from meshconv3d.service.workers import WorkerPool
from meshconv3d.service.workers.tasks import Setup
from tests.articulated import sample_paths
from tests.processes import until, workers
from tests.service.conftest import Service
from tests.service.metrics import metrics, value


@pytest.fixture(scope="module")
def counted(start: Callable[..., Service]) -> Service:
    """A service that these tests alone ask."""
    return start("--workers", "1", "--max-upload-bytes", "300000")


def test_requests_are_counted_by_route_status_and_fault(counted: Service) -> None:
    def post(content: bytes) -> httpx.Response:
        return httpx.post(f"{counted.url}/v1/classify", content=content)

    def count(status: int, fault: str, route: str = "/v1/classify") -> float:
        return value(counted, "requests_total", route=route, status=str(status), fault=fault)

    expected = {(200, ""): 2, (422, "no-faces"): 3, (413, "body-too-large"): 1}
    before = {key: count(*key) for key in expected}
    for _ in range(2):
        post(sample_paths()["ants"].read_bytes())
    for _ in range(3):
        post(b"v 0 0 0\n")
    post(b"#" * 300_001)
    assert {key: count(*key) - before[key] for key in expected} == expected


def test_every_stage_is_timed(counted: Service) -> None:
    stages = ["upload", "queue", "read", "prepare", "topology", "infer"]
    before = [value(counted, "stage_seconds_count", stage=stage) for stage in stages]
    httpx.post(f"{counted.url}/v1/classify", content=sample_paths()["ants"].read_bytes())
    after = [value(counted, "stage_seconds_count", stage=stage) for stage in stages]
    assert [late - early for early, late in zip(before, after, strict=True)] == [1] * 6


def test_each_mesh_of_a_batch_is_counted(counted: Service) -> None:
    before = [value(counted, "meshes_total", fault=fault) for fault in ("", "no-faces")]
    ants = sample_paths()["ants"].read_bytes()
    files = [("file", ("a.obj", content)) for content in (ants, b"v 0 0 0\n", ants)]
    httpx.post(f"{counted.url}/v1/classify/batch", files=files)
    after = [value(counted, "meshes_total", fault=fault) for fault in ("", "no-faces")]
    assert [late - early for early, late in zip(before, after, strict=True)] == [2, 1]


def test_paths_that_callers_invent_make_no_series(counted: Service) -> None:
    for path in (
        "/a",
        "/b/c",
        "/assets/a",
        "/assets/b",
        "/v1/models/x",
        "/v1/models/y",
        "/v2/models/z",
    ):
        httpx.get(f"{counted.url}{path}")
        httpx.post(f"{counted.url}{path}")
    routes = {dict(labels).get("route") for _, labels in metrics(counted)} - {None}
    known = set(httpx.get(f"{counted.url}/openapi.json").json()["paths"])
    assert routes <= known | {"none", "/", "/assets", "/openapi.json"}
    assert {"none", "/v1/models/{name}", "/v2/models/{name}"} <= routes


def test_files_of_the_page_are_counted_as_such(counted: Service) -> None:
    (script,) = re.findall(r'src="\./(assets/[^"]+\.js)"', httpx.get(counted.url).text)
    for path, status in ((script, "200"), ("assets/nothing", "404")):
        fault = "" if status == "200" else "not-found"
        labels = {"route": "/assets", "status": status, "fault": fault}
        before = value(counted, "requests_total", **labels)
        httpx.get(f"{counted.url}/{path}")
        assert value(counted, "requests_total", **labels) == before + 1


def test_a_worker_that_is_replaced_is_counted(counted: Service) -> None:
    before = value(counted, "worker_restarts_total")
    (worker,) = workers(counted.process.pid)
    os.kill(worker, signal.SIGKILL)
    until(lambda: value(counted, "worker_restarts_total") == before + 1)
    until(lambda: value(counted, "workers_alive") == 1)
    assert "another has taken its place" in counted.log.read_text()


def test_the_process_and_its_models(counted: Service) -> None:
    (card,) = httpx.get(f"{counted.url}/v1/models").json()["models"]
    assert value(counted, "model_info", name=card["name"], sha256=card["sha256"]) == 1
    names = {name for name, _ in metrics(counted)}
    assert {"process_resident_memory_bytes", "python_info", "meshconv3d_queue_bytes"} <= names


def test_openmetrics_for_those_who_ask_for_it(counted: Service) -> None:
    accept = {"accept": "application/openmetrics-text; version=1.0.0"}
    response = httpx.get(f"{counted.url}/metrics", headers=accept)
    assert response.headers["content-type"].startswith("application/openmetrics-text")
    assert response.text.endswith("# EOF\n")


def test_two_apps_in_one_process_count_apart() -> None:
    pool = WorkerPool(Setup((), Limits(), memory_bytes=0, seconds=1.0), workers=0)
    first, second = (Metrics(pool, Admission(9, 9999, 9.0, workers=1)) for _ in range(2))
    assert first.registry is not second.registry
