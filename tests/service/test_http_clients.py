"""What clients do that is not quite as described: read where that is safe, told where it is not."""

import socket
from pathlib import Path

import httpx
import pytest

from tests.service.conftest import Service


def test_a_body_that_curl_declares_as_a_form_is_read(client: httpx.Client, meshes: Path) -> None:
    content = (meshes / "ring.obj").read_bytes()
    declared = {"content-type": "application/x-www-form-urlencoded"}
    assert client.post("/v1/classify", content=content, headers=declared).status_code == 200


def test_an_encoded_body_is_told_from_a_damaged_one(client: httpx.Client) -> None:
    declared = {"content-encoding": "gzip", "content-type": "model/stl"}
    response = client.post("/v1/classify", content=b"\x1f\x8b", headers=declared)
    assert response.status_code == 415
    assert response.json()["fault"] == "unknown-encoding"


def test_no_redirect_is_built_from_the_callers_host(client: httpx.Client) -> None:
    assert client.post("/v1/classify/").status_code == 404
    response = client.post("/v1/classify/", headers={"host": "elsewhere.example"})
    assert response.status_code == 421
    assert "elsewhere" not in str(response.headers) + response.text


@pytest.mark.parametrize(
    "path", ["/", "/livez", "/readyz", "/metrics", "/v1/formats", "/v1/samples/boat.obj", "/v2"]
)
def test_head_is_answered_as_get_is(client: httpx.Client, path: str) -> None:
    told, whole = client.head(path), client.get(path)
    assert (told.status_code, told.content) == (200, b"")
    assert told.headers["content-type"] == whole.headers["content-type"]
    if path != "/metrics":
        assert told.headers["content-length"] == str(len(whole.content))


def test_head_is_no_way_to_ask_for_what_is_posted(client: httpx.Client) -> None:
    assert client.head("/v1/classify").status_code == 405


def test_who_leaves_in_the_middle_leaves_no_traceback(service: Service) -> None:
    host, port = service.url.removeprefix("http://").split(":")
    before = service.log.read_text()
    with socket.create_connection((host, int(port)), timeout=30) as connection:
        connection.sendall(
            b"POST /v1/classify HTTP/1.1\r\nHost: localhost\r\nContent-Length: 99\r\n\r\nv 0"
        )
    assert httpx.get(f"{service.url}/readyz").status_code == 200
    assert "Traceback" not in service.log.read_text()[len(before) :]
