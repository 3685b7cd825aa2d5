"""`meshconv3d serve` from start to stop."""

import errno
import json
import os
import re
import resource
import shlex
import signal
import socket
import subprocess
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

import httpx
import onnx
import pytest

from meshconv3d.export.metadata import PREFIX
from meshconv3d.service.http.server import CannotListen, bind
from meshconv3d.service.settings import Settings
from tests.commands import PROGRAM, meshconv3d, program
from tests.processes import family, held, until, workers
from tests.service.conftest import Service
from tests.service.metrics import queue, value

README = Path(__file__).parents[2] / "README.md"
ANSWERED = {"route": "/v1/classify", "status": "200", "fault": ""}
OPERATIONS = README.parent / "docs" / "operations.md"


def test_a_stop_lets_the_running_request_finish(
    start: Callable[..., Service], meshes: Path
) -> None:
    service = start()
    content = (meshes / "ring.obj").read_bytes()
    host, port = service.url.removeprefix("http://").split(":")
    with socket.create_connection((host, int(port)), timeout=30) as connection:
        head = (
            f"POST /v1/classify HTTP/1.1\r\nHost: localhost\r\nContent-Length: {len(content)}\r\n"
        )
        connection.sendall(head.encode() + b"Expect: 100-continue\r\n\r\n")
        assert connection.recv(1000).startswith(b"HTTP/1.1 100 ")  # the request has begun
        service.process.send_signal(signal.SIGTERM)
        connection.sendall(content)
        assert connection.recv(1000).startswith(b"HTTP/1.1 200 ")
    assert service.process.wait(30) == 0
    with pytest.raises(httpx.ConnectError):
        httpx.get(f"{service.url}/livez")
    assert "Traceback" not in service.log.read_text()


def test_a_stop_is_told_and_loses_nothing(start: Callable[..., Service], meshes: Path) -> None:
    """Even where all processes are told at once, as some supervisors do."""
    service = start("--workers", "1")
    content = (meshes / "ring.obj").read_bytes()
    with ThreadPoolExecutor(1) as pool, held(workers(service.process.pid)):
        accepted = pool.submit(
            httpx.post, f"{service.url}/v1/classify", content=content, timeout=60
        )
        until(lambda: queue(service) == 1)
        for process in (service.process.pid, *family(service.process.pid)):
            os.kill(process, signal.SIGTERM)
        until(lambda: httpx.get(f"{service.url}/readyz").status_code == 503)
        refused = httpx.post(f"{service.url}/v1/classify", content=content)
        assert (refused.status_code, refused.json()["fault"]) == (503, "full")
        assert "stopping" in refused.json()["detail"]
        assert httpx.get(f"{service.url}/livez").status_code == 200
    assert accepted.result().status_code == 200
    assert service.process.wait(30) == 0
    assert "Traceback" not in service.log.read_text()


def test_a_stop_in_the_middle_of_a_batch_answers_all_of_it(
    start: Callable[..., Service], meshes: Path
) -> None:
    service = start("--workers", "1")
    files = [("file", ("ring.obj", (meshes / "ring.obj").read_bytes()))] * 20
    url = f"{service.url}/v1/classify/batch"
    with ThreadPoolExecutor(1) as pool, held(workers(service.process.pid)):
        answer = pool.submit(httpx.post, url, files=files, timeout=60)
        until(lambda: queue(service) == 20)
        service.process.send_signal(signal.SIGTERM)
        until(lambda: httpx.get(f"{service.url}/readyz").status_code == 503)
    lines = [json.loads(line) for line in answer.result().text.splitlines()]
    assert [line["class"] for line in lines] == [lines[0]["class"]] * 20
    assert service.process.wait(30) == 0
    assert "Traceback" not in service.log.read_text()


@pytest.mark.parametrize("patience", ["grace", "second signal"])
def test_a_stop_does_not_wait_for_ever(
    start: Callable[..., Service], meshes: Path, patience: str
) -> None:
    """What has no answer by then is told so, each mesh of a batch."""
    service = start("--workers", "1", "--grace-seconds", "1" if patience == "grace" else "60")
    content = (meshes / "ring.obj").read_bytes()
    files = [("file", ("ring.obj", content))] * 3
    began = family(service.process.pid)

    def post(path: str, **body: Any) -> httpx.Response:
        return httpx.post(f"{service.url}/v1/{path}", **body, timeout=60)

    with ThreadPoolExecutor(2) as pool, held(workers(service.process.pid)):
        one = pool.submit(post, "classify", content=content)
        several = pool.submit(post, "classify/batch", files=files)
        until(lambda: queue(service) == 4)
        service.process.send_signal(signal.SIGTERM)
        if patience == "second signal":
            until(lambda: httpx.get(f"{service.url}/readyz").status_code == 503)
            service.process.send_signal(signal.SIGTERM)
        assert service.process.wait(10) == 0
        assert (one.result().status_code, one.result().json()["fault"]) == (503, "full")
        lines = [json.loads(line) for line in several.result().text.splitlines()]
        assert [line["error"]["fault"] for line in lines] == ["full"] * 3
        until(lambda: not any(Path(f"/proc/{process}").exists() for process in began))
    assert "Traceback" not in service.log.read_text()


def test_a_service_that_is_killed_leaves_nothing(
    start: Callable[..., Service], meshes: Path
) -> None:
    service = start("--workers", "2")
    content = (meshes / "ring.obj").read_bytes()
    began = family(service.process.pid)

    def ask_on() -> None:
        with httpx.Client(base_url=service.url) as client:
            while True:
                client.post("/v1/classify", content=content)

    with ThreadPoolExecutor(6) as pool:
        lost = [pool.submit(ask_on) for _ in range(6)]
        until(lambda: value(service, "requests_total", **ANSWERED) > 30)
        service.process.kill()
        assert all(isinstance(each.exception(), httpx.TransportError) for each in lost)
    until(lambda: not any(Path(f"/proc/{process}").exists() for process in began))
    assert "Traceback" not in service.log.read_text()


def test_several_models_are_told_apart_by_name(
    start: Callable[..., Service], meshes: Path, model_file: Path
) -> None:
    service = start("--model", "shrec11")
    content = (meshes / "ring.obj").read_bytes()
    models = httpx.get(f"{service.url}/v1/models").json()["models"]
    assert [model["name"] for model in models] == ["tiny", "shrec11"]

    def ask(query: str) -> httpx.Response:
        return httpx.post(f"{service.url}/v1/classify{query}", content=content)

    for query, name in (("", "tiny"), ("?model=tiny", "tiny"), ("?model=shrec11", "shrec11")):
        assert ask(query).json()["model"]["name"] == name
    assert len(ask("?model=shrec11").json()["scores"]) == 30
    missing = ask("?model=other")
    assert (missing.status_code, missing.json()["fault"]) == (404, "not-found")
    assert "tiny, shrec11" in missing.json()["detail"]


def test_models_of_one_name_are_refused(model_file: Path) -> None:
    done = program("serve", "--port", 0, "--model", model_file, "--model", model_file)
    assert done.returncode == 2
    assert "told apart by their names" in done.stderr


def test_a_damaged_model_beside_a_good_one_is_refused(model_file: Path, tmp_path: Path) -> None:
    path = tmp_path / "damaged.onnx"
    path.write_bytes(model_file.read_bytes()[:5000])
    variables = {"MESHCONV3D_MODELS": f"shrec11,{path}"}
    done = program("serve", "--port", 0, variables=variables)
    assert done.returncode == 2
    assert str(path) in done.stderr
    assert "Traceback" not in done.stderr


def test_the_help_and_the_docs_list_every_setting() -> None:
    text = meshconv3d("serve", "--help").stdout
    table = OPERATIONS.read_text(encoding="utf-8")
    for name, setting in Settings.model_fields.items():
        several = isinstance(setting.get_default(call_default_factory=True), tuple)
        flag = "--" + (name.removesuffix("s") if several else name).replace("_", "-")
        assert re.search(rf"^  {flag} ", text, re.MULTILINE), name
        row = rf"^\| `MESHCONV3D_{name.upper()}` \|.*\| {re.escape(setting.description or '?')} \|$"
        assert re.search(row, table, re.MULTILINE), name


def test_variables_set_what_flags_do_not(start: Callable[..., Service], model_file: Path) -> None:
    """And an interrupt stops it, too."""
    service = start(MESHCONV3D_MAX_UPLOAD_BYTES="100", MESHCONV3D_MODELS="nothing")
    response = httpx.post(f"{service.url}/v1/classify", content=b"#" * 101)
    assert response.json()["limit"] == 100
    models = httpx.get(f"{service.url}/v1/models").json()["models"]
    assert [model["name"] for model in models] == ["tiny"]  # the flag's, not the variable's
    assert service.stop(signal.SIGINT) == 0
    assert "Traceback" not in service.log.read_text()


@pytest.mark.parametrize(
    ("command", "name", "change", "says"),
    [
        (
            ["serve", "--port", 0],
            "probe",
            {"scores": [9.0, 9.0, 9.0]},
            "model tiny scores the sample",
        ),
        (
            ["classify", README],
            "config",
            {"patch_size": 9},
            "model tiny cannot classify the sample",
        ),
    ],
)
def test_a_model_that_fails_its_self_test_answers_nothing(
    model_file: Path, tmp_path: Path, command: list, name: str, change: dict, says: str
) -> None:
    graph = onnx.load(model_file)
    (entry,) = (entry for entry in graph.metadata_props if entry.key == PREFIX + name)
    entry.value = json.dumps(json.loads(entry.value) | change)
    path = tmp_path / "other.onnx"
    path.write_bytes(graph.SerializeToString())
    done = program(*command, "--model", path)
    assert (done.returncode, done.stdout) == (2, "")
    assert says in done.stderr
    assert "Traceback" not in done.stderr
    assert "running on" not in done.stderr


@pytest.mark.parametrize(
    ("options", "variables", "reason"),
    [
        (["--port", "99999"], {}, "bad setting: port"),
        (["--workers", "0"], {}, "bad setting: workers"),
        (["--max-upload-bytes", "0"], {}, "bad setting: max_upload_bytes"),
        (["--max-faces", "many"], {}, "bad setting: max_faces"),
        (["--deadline-seconds", "0"], {}, "bad setting: deadline_seconds"),
        (["--worker-memory-bytes", "1000"], {}, "bad setting: worker_memory_bytes"),
        (["--worker-memory-bytes", str(2**63)], {}, "bad setting: worker_memory_bytes"),
        (["--max-queue-bytes", "1000"], {}, "max_queue_bytes (1000) must be at least"),
        ([], {"MESHCONV3D_MODELS": ","}, "bad setting: models"),
        ([], {"MESHCONV3D_WORKERS": "many"}, "bad setting: workers"),
    ],
)
def test_bad_settings_are_refused_at_the_start(
    options: list[str], variables: dict[str, str], reason: str
) -> None:
    done = meshconv3d("serve", *options, variables=variables)
    assert done.returncode == 2
    assert reason in done.stderr
    assert "Traceback" not in done.stderr


def test_a_model_that_is_not_there_is_refused_at_the_start() -> None:
    done = program("serve", "--model", "nothing")
    assert done.returncode == 2
    assert "no model 'nothing'" in done.stderr
    assert "Traceback" not in done.stderr


def test_an_address_that_cannot_be_had_is_told(service: Service, model_file: Path) -> None:
    port = service.url.rpartition(":")[2]
    done = program("serve", "--model", model_file, "--port", port)
    assert done.returncode == 2
    assert f"cannot listen at 127.0.0.1, port {port}: " in done.stderr
    assert "the port is taken; choose another with --port" in " ".join(done.stderr.split())
    assert "starting" not in done.stderr  # no worker was started for it
    assert "Traceback" not in done.stderr


def test_what_is_no_host_is_told() -> None:
    words = "cannot listen at no-such-host.invalid, port 80: .* no host; --host takes"
    with pytest.raises(CannotListen, match=words):
        bind(Settings(host="no-such-host.invalid", port=80))


def test_a_port_that_needs_rights_is_told(monkeypatch: pytest.MonkeyPatch) -> None:
    def refuse(*_: object) -> None:
        raise PermissionError(errno.EACCES, "Permission denied")  # who runs tests may have them

    monkeypatch.setattr(socket.socket, "bind", refuse)
    with pytest.raises(CannotListen, match=r"below 1024.*choose another with --port"):
        bind(Settings(host="127.0.0.1", port=80))


def test_open_files_are_raised_to_what_the_connections_need(
    start: Callable[..., Service], model_file: Path
) -> None:
    before = resource.getrlimit(resource.RLIMIT_NOFILE)
    resource.setrlimit(resource.RLIMIT_NOFILE, (256, before[1]))
    try:
        service = start("--workers", "1", "--max-connections", "300")
    finally:
        resource.setrlimit(resource.RLIMIT_NOFILE, before)
    soft, hard = resource.prlimit(service.process.pid, resource.RLIMIT_NOFILE)
    assert soft > 600
    assert hard == before[1]


def test_more_connections_than_open_files_are_refused_at_the_start() -> None:
    with_few = f"ulimit -n 1000; exec {shlex.quote(PROGRAM)} serve --workers 1 --port 0"
    done = subprocess.run(["sh", "-c", with_few], capture_output=True, text=True, timeout=60)
    assert done.returncode == 2
    words = " ".join(done.stderr.split())
    assert (
        "the system allows 1000; raise its limit (ulimit -Hn), or lower --max-connections" in words
    )
    possible = int(words.rpartition(" to ")[2])
    assert 300 < possible < 500
