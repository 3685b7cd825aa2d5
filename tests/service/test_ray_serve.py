"""The app behind Ray Serve's proxy."""

import socket
from collections.abc import Iterator
from pathlib import Path

import httpx
import pytest

from meshconv3d.model.samples import sample_paths
from meshconv3d.service.settings import Settings

pytest.importorskip("ray", reason="needs the extra `ray`")

import ray
from ray import serve

from meshconv3d.service.http.ray_serve import application

ROOT = Path(__file__).parents[2]
LIMIT = 400_000


@pytest.fixture(scope="module")
def served(model_file: Path) -> Iterator[str]:
    """The URL of the app, with the settings of the fixture `service`."""
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        port = free.getsockname()[1]
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("PYTHONPATH", str(ROOT))
        ray.init(
            num_cpus=2,
            object_store_memory=80 * 2**20,
            include_dashboard=False,
            log_to_driver=False,
        )
        serve.start(http_options={"host": "127.0.0.1", "port": port})
        settings = Settings(models=(str(model_file),), workers=1, max_upload_bytes=LIMIT)
        serve.run(application(settings), name="meshconv3d")
        yield f"http://127.0.0.1:{port}"
        serve.shutdown()
        ray.shutdown()


def test_it_answers_as_the_plain_service(served: str, client: httpx.Client) -> None:
    requests = [
        {"content": sample_paths()[name].read_bytes(), "headers": {"content-type": media_type}}
        for name, media_type in [
            ("two_balls", "model/gltf-binary"),
            ("hand", "model/stl"),
            ("lamp", "model/stl"),
        ]
    ]
    requests.append({"files": {"file": ("large.obj", bytes(LIMIT + 1))}})
    for request in requests:
        plain = client.post("/v1/classify?top=2", **request)
        behind = httpx.post(f"{served}/v1/classify?top=2", timeout=60, **request)
        assert behind.status_code == plain.status_code
        assert behind.headers["content-type"] == plain.headers["content-type"]
        assert timeless(behind) == timeless(plain)
    assert plain.status_code == 413


def timeless(response: httpx.Response) -> dict:
    return response.json() | {"timings_ms": None, "request_id": None}


@pytest.mark.parametrize("path", ["/", "/readyz", "/v1/models", "/openapi.json"])
def test_all_of_the_app_is_there(served: str, client: httpx.Client, path: str) -> None:
    behind, plain = httpx.get(served + path), client.get(path)
    assert behind.status_code == 200
    assert behind.content == plain.content
