"""Behind nginx with the configuration in deploy/, under a path of its own."""

import os
import re
import shutil
import socket
import subprocess
from collections.abc import Iterator
from http.client import HTTPConnection
from pathlib import Path

import httpx
import pytest

from tests.processes import until
from tests.service.conftest import Service

CONFIGURATION = Path(__file__).parents[2] / "deploy" / "nginx.conf"


@pytest.fixture(scope="module")
def proxied(service: Service, tmp_path_factory: pytest.TempPathFactory) -> Iterator[str]:
    """The address of the service behind nginx."""
    if (nginx := shutil.which("nginx")) is None:
        pytest.skip("no nginx: apt-get install nginx-light")
    folder = tmp_path_factory.mktemp("nginx")
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        port = probe.getsockname()[1]
    own = "".join(
        f"{kind}_temp_path {folder}/{kind};"
        for kind in ("client_body", "proxy", "fastcgi", "uwsgi", "scgi")
    )
    text = CONFIGURATION.read_text(encoding="utf-8")
    for found, ours in (
        ("listen 8080;", f"listen 127.0.0.1:{port};"),
        ("http://127.0.0.1:8000/", f"{service.url}/"),
        ("http {", f"http {{ access_log off; {own}"),
    ):
        assert found in text
        text = text.replace(found, ours)
    (folder / "nginx.conf").write_text(text)
    settings = f"daemon off; pid {folder}/pid; error_log {folder}/errors;"
    settings += " user root;" if os.getuid() == 0 else ""
    process = subprocess.Popen([nginx, "-p", folder, "-c", folder / "nginx.conf", "-g", settings])
    try:
        until(lambda: process.poll() is not None or (folder / "pid").exists())
        assert process.poll() is None, (folder / "errors").read_text()
        yield f"http://127.0.0.1:{port}/meshes"
    finally:
        process.terminate()
        process.wait(10)


def test_meshes_are_classified_behind_it(proxied: str, meshes: Path) -> None:
    content = (meshes / "ring.obj").read_bytes()
    answer = httpx.post(f"{proxied}/v1/classify", files={"file": ("ring.obj", content)})
    assert answer.status_code == 200
    assert answer.json()["file"] == "ring.obj"
    files = [("file", (f"{i}.obj", content)) for i in range(3)]
    lines = httpx.post(f"{proxied}/v1/classify/batch", files=files).text.splitlines()
    assert len(lines) == 3


@pytest.mark.parametrize("page", ["/", "/docs"])
def test_pages_find_their_files_under_its_path(proxied: str, page: str) -> None:
    text = httpx.get(f"{proxied}{page}").text
    references = re.findall(r'(?:src|href)="\./([^"#]+)"', text)
    assert references
    for reference in references:
        assert httpx.get(f"{proxied}/{reference}").status_code == 200


def test_the_description_is_of_the_path_where_it_lies(proxied: str) -> None:
    description = httpx.get(f"{proxied}/openapi.json").json()
    assert description["servers"] == [{"url": "."}]


def test_what_is_too_large_is_told_by_the_service_or_by_the_proxy(proxied: str) -> None:
    told = httpx.post(f"{proxied}/v1/classify", content=b"v" * 2**20)
    assert (told.status_code, told.json()["fault"]) == (413, "body-too-large")
    connection = HTTPConnection(httpx.URL(proxied).netloc.decode())
    connection.putrequest("POST", "/meshes/v1/classify")
    connection.putheader("content-length", str(129 * 2**20))
    connection.endheaders()
    answer = connection.getresponse()
    assert (answer.status, b"nginx" in answer.read()) == (413, True)
    connection.close()
