"""The page as it is served: headers, caching, and nothing from elsewhere."""

import re
from dataclasses import asdict
from pathlib import Path

import httpx
import pytest

from meshconv3d.model.loading import Limits, load_mesh
from meshconv3d.model.samples import sample_paths
from tests.service.conftest import LIMIT

BUILT = Path(__file__).parents[2] / "service" / "page"
ASSETS = sorted(path.name for path in (BUILT / "assets").iterdir())


@pytest.mark.parametrize("path", ["/", "/docs"])
def test_the_pages(client: httpx.Client, path: str) -> None:
    response = client.get(path)
    assert response.status_code == 200
    assert response.headers["content-type"].startswith("text/html")
    assert response.headers["cache-control"] == "no-cache"
    assert client.head(path).headers["content-length"] == str(len(response.content))


@pytest.mark.parametrize("path", ["/", "/docs", f"/assets/{ASSETS[0]}"])
def test_nothing_is_taken_from_elsewhere(client: httpx.Client, path: str) -> None:
    headers = client.get(path).headers
    assert "," not in headers["content-security-policy"]  # browsers obey all of several
    policy = dict(
        directive.split(" ", 1) for directive in headers["content-security-policy"].split("; ")
    )
    assert policy["default-src"] == "'none'"
    assert policy["script-src"] == "'self'"
    assert policy["style-src"] == "'self'"
    assert policy["connect-src"] == "'self' data:"
    assert not any("unsafe" in sources or "http" in sources for sources in policy.values())
    assert headers["x-content-type-options"] == "nosniff"


@pytest.mark.parametrize("path", ["/", "/docs"])
def test_the_pages_name_only_their_own_files(client: httpx.Client, path: str) -> None:
    text = client.get(path).text
    assert not re.search(r"<script>|<style|style=|\bon\w+=|javascript:", text)
    for reference in re.findall(r'(?:src|href)="([^"#]+)"', text):
        assert reference.startswith("./")
        assert client.get(reference[1:]).status_code == 200, reference


@pytest.mark.parametrize("name", ASSETS)
def test_assets_never_change_under_their_names(client: httpx.Client, name: str) -> None:
    response = client.get(f"/assets/{name}")
    assert response.content == (BUILT / "assets" / name).read_bytes()
    assert response.headers["cache-control"] == "public, max-age=31536000, immutable"
    assert re.search(r"-[\w-]{8}\.\w+$", name)
    assert {"js": "javascript", "css": "css", "svg": "svg"}[name.rpartition(".")[2]] in (
        response.headers["content-type"]
    )


@pytest.mark.parametrize("path", ["/assets/none.js", "/assets/../index.html", "/assets/%2e%2e/x"])
def test_no_other_files(client: httpx.Client, path: str) -> None:
    response = client.get(path)
    assert response.status_code == 404
    assert response.headers["content-type"] == "application/problem+json"


def test_samples(client: httpx.Client) -> None:
    listed = client.get("/v1/samples").json()["samples"]
    assert [sample["name"] for sample in listed] == list(sample_paths())
    for sample in listed:
        response = client.get(f"/v1/samples/{sample['file']}")
        assert len(response.content) == sample["bytes"]
        assert load_mesh(response.content, sample["file"])
    missing = client.get("/v1/samples/cup.obj")
    assert (missing.status_code, missing.json()["fault"]) == (404, "not-found")


def test_limits(client: httpx.Client) -> None:
    expected = {"upload_bytes": LIMIT, **asdict(Limits())}
    assert client.get("/v1/limits").json() == expected
