"""Hostile files over HTTP: each gets a reason, opens nothing, and leaves the service as it was."""

import json
import os
import socket
from collections.abc import Callable, Iterator
from pathlib import Path

import httpx
import pytest

from tests.hostile import HOSTILE
from tests.service.conftest import Service
from tests.service.test_http_problems import problem_of

# A form takes no name without end, and one without an extension declares nothing there.
OTHERWISE_NAMED = {"others: the name box", "others: the name obj.", "others: a name of 100 kB"}


@pytest.fixture(scope="module")
def sturdy(start: Callable[..., Service]) -> Service:
    """One worker, so that whatever a file does to it meets the next."""
    return start("--workers", "1", "--worker-memory-bytes", str(400 * 2**20))


@pytest.fixture(scope="module")
def connection(sturdy: Service) -> Iterator[httpx.Client]:
    with httpx.Client(base_url=sturdy.url, timeout=60) as client:
        yield client


def post(client: httpx.Client, name: str, content: bytes) -> httpx.Response:
    return client.post("/v1/classify", files={"file": (name, content)})


@pytest.mark.parametrize("title", HOSTILE)
def test_every_hostile_file_gets_a_reason(connection: httpx.Client, title: str) -> None:
    file = HOSTILE[title]
    response = post(connection, file.name, file.data)
    if title in OTHERWISE_NAMED:
        assert response.status_code < 500
    elif file.fault is not None:
        problem = problem_of(response, response.status_code)
        assert 400 <= response.status_code < 500, problem
        assert problem["fault"] == file.fault
    elif response.status_code != 200:
        # What can be read need not be a mesh that can be simplified.
        assert problem_of(response, 422)["fault"] != "worker-crashed"
    assert connection.get("/readyz").status_code == 200


@pytest.fixture
def trap() -> Iterator[socket.socket]:
    """A port that nobody may knock at."""
    with socket.create_server(("127.0.0.1", 0)) as listening:
        listening.settimeout(0.3)
        yield listening


@pytest.fixture
def planted(tmp_path: Path) -> Path:
    """A file that whoever opens it would wait for ever: a pipe that nobody writes to."""
    path = tmp_path / "planted.bin"
    os.mkfifo(path)
    return path


TRIANGLE = "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 2 3\nf 1 2 4\nf 1 3 4\nf 2 3 4\n"


def gltf(uri: str) -> bytes:
    return json.dumps(
        {
            "asset": {"version": "2.0"},
            "buffers": [{"uri": uri, "byteLength": 36}],
            "bufferViews": [{"buffer": 0, "byteLength": 36}],
            "accessors": [{"bufferView": 0, "componentType": 5126, "count": 3, "type": "VEC3"}],
            "meshes": [{"primitives": [{"attributes": {"POSITION": 0}}]}],
            "nodes": [{"mesh": 0}],
            "scenes": [{"nodes": [0]}],
            "images": [{"uri": uri}],
        }
    ).encode()


def obj(uri: str) -> bytes:
    return f"mtllib {uri}\nmap_Kd {uri}\ncall {uri}\n{TRIANGLE}".encode()


def ply(uri: str) -> bytes:
    return (
        f"ply\nformat ascii 1.0\ncomment TextureFile {uri}\nelement vertex 4\nproperty float x\n"
        "property float y\nproperty float z\nelement face 4\n"
        "property list uchar int vertex_indices\n"
        "end_header\n0 0 0\n1 0 0\n0 1 0\n0 0 1\n3 0 1 2\n3 0 1 3\n3 0 2 3\n3 1 2 3\n"
    ).encode()


FORMATS = {"box.gltf": (gltf, 400), "box.obj": (obj, 200), "box.ply": (ply, 200)}


@pytest.mark.parametrize("name", FORMATS)
def test_no_reference_is_followed(connection, trap, planted, name) -> None:
    make, status = FORMATS[name]
    port = trap.getsockname()[1]
    for uri in (f"http://127.0.0.1:{port}/x.bin", f"file://{planted}", str(planted), planted.name):
        assert post(connection, name, make(uri)).status_code == status
    with pytest.raises(TimeoutError):
        trap.accept()
