"""`meshconv3d serve` from start to stop."""

import json
import signal
import socket
from collections.abc import Callable
from pathlib import Path

import httpx
import onnx
import pytest

from export.metadata import PREFIX
from tests.commands import meshconv3d
from tests.service.conftest import Service

README = Path(__file__).parents[2] / "README.md"


def test_a_stop_lets_the_running_request_finish(
    start: Callable[..., Service], meshes: Path
) -> None:
    service = start()
    content = (meshes / "ring.obj").read_bytes()
    host, port = service.url.removeprefix("http://").split(":")
    with socket.create_connection((host, int(port)), timeout=30) as connection:
        head = f"POST /v1/classify HTTP/1.1\r\nHost: a\r\nContent-Length: {len(content)}\r\n"
        connection.sendall(head.encode() + b"Expect: 100-continue\r\n\r\n")
        assert connection.recv(1000).startswith(b"HTTP/1.1 100 ")  # the request has begun
        service.process.send_signal(signal.SIGTERM)
        connection.sendall(content)
        assert connection.recv(1000).startswith(b"HTTP/1.1 200 ")
    assert service.process.wait(30) == 0
    with pytest.raises(httpx.ConnectError):
        httpx.get(f"{service.url}/livez")
    assert "Traceback" not in service.log.read_text()


def test_an_interrupt_stops_it_too(start: Callable[..., Service]) -> None:
    service = start()
    assert service.stop(signal.SIGINT) == 0
    assert "Traceback" not in service.log.read_text()


def test_variables_set_what_flags_do_not(start: Callable[..., Service], model_file: Path) -> None:
    service = start(MESHCONV3D_MAX_UPLOAD_BYTES="100", MESHCONV3D_MODELS="nothing")
    response = httpx.post(f"{service.url}/v1/classify", content=b"#" * 101)
    assert response.json()["limit"] == 100
    models = httpx.get(f"{service.url}/v1/models").json()["models"]
    assert [model["name"] for model in models] == ["tiny"]  # the flag's, not the variable's


@pytest.mark.parametrize("command", [["serve", "--port", 0], ["classify", README]])
def test_a_model_that_fails_its_self_test_answers_nothing(
    model_file: Path, tmp_path: Path, command: list
) -> None:
    graph = onnx.load(model_file)
    (entry,) = (entry for entry in graph.metadata_props if entry.key == PREFIX + "probe")
    entry.value = json.dumps(json.loads(entry.value) | {"scores": [9.0, 9.0, 9.0]})
    path = tmp_path / "other.onnx"
    path.write_bytes(graph.SerializeToString())
    done = meshconv3d(*command, "--model", path)
    assert (done.returncode, done.stdout) == (2, "")
    assert "model tiny scores the sample" in done.stderr
    assert "running on" not in done.stderr


@pytest.mark.parametrize(
    ("options", "variables", "reason"),
    [
        (["--port", "99999"], {}, "bad setting: port"),
        (["--workers", "0"], {}, "bad setting: workers"),
        (["--max-upload-bytes", "0"], {}, "bad setting: max_upload_bytes"),
        (["--model", "nothing"], {}, "no model 'nothing'"),
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


def test_an_occupied_port_is_told(service: Service, model_file: Path) -> None:
    port = service.url.rpartition(":")[2]
    done = meshconv3d("serve", "--model", model_file, "--port", port)
    assert done.returncode not in (0, 2)
    assert "address already in use" in done.stderr
