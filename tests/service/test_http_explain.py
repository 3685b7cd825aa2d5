"""POST /v1/explain on a running service: three forms, any class, the errors of classify."""

import json
from collections.abc import Callable
from pathlib import Path

import httpx
import pytest

from meshconv3d.model.loading import load_mesh
from meshconv3d.service.http.v1 import preferred
from tests.commands import meshconv3d
from tests.service.conftest import Service

OFFERED = ["model/gltf-binary", "model/ply", "application/json"]
BROWSER = "text/html,application/xhtml+xml,application/xml;q=0.9,*/*;q=0.8"


@pytest.fixture
def ring(meshes: Path) -> bytes:
    return (meshes / "ring.obj").read_bytes()


@pytest.mark.parametrize(
    ("accept", "media_type"),
    [
        ("", "model/gltf-binary"),
        ("*/*", "model/gltf-binary"),
        (BROWSER, "model/gltf-binary"),
        ("model/*", "model/gltf-binary"),
        ("model/ply", "model/ply"),
        ("Model/PLY; q=0.5, text/html", "model/ply"),
        ("model/ply;q=0.5, application/json", "application/json"),
        ("*/*;q=0.1, application/json;q=0.2", "application/json"),
        ("*/*, model/gltf-binary;q=0", "model/ply"),
        ("text/html", None),
        ("application/json;q=0", None),
        ("application/json;q=much", None),
    ],
)
def test_what_a_client_likes_best(accept: str, media_type: str | None) -> None:
    assert preferred(accept, OFFERED) == media_type


@pytest.mark.parametrize(("media_type", "extension"), [(OFFERED[0], "glb"), (OFFERED[1], "ply")])
def test_a_coloured_mesh(
    client: httpx.Client, ring: bytes, media_type: str, extension: str
) -> None:
    response = client.post("/v1/explain", content=ring, headers={"accept": media_type})
    assert response.status_code == 200, response.text
    assert response.headers["content-type"] == media_type
    assert response.headers["vary"] == "accept"
    assert len(load_mesh(response.content, extension).faces) == 500


@pytest.mark.parametrize("label", [None, "ball", "box", "ring"])
def test_numbers_that_sum_to_the_score(
    client: httpx.Client, ring: bytes, label: str | None
) -> None:
    response = client.post(
        "/v1/explain",
        files={"file": ("ring.obj", ring)},
        params={"class": label} if label else {},
    )  # JSON is the default
    record = response.json()
    plain = client.post("/v1/classify", files={"file": ("ring.obj", ring)}).json()
    evidence = record.pop("evidence")
    for one in (record, plain):
        del one["timings_ms"]
    assert record == plain
    assert evidence["class"] == (label or plain["class"])
    score = next(s["score"] for s in plain["scores"] if s["class"] == evidence["class"])
    assert sum(evidence["contributions"]) + evidence["bias"] == pytest.approx(score, abs=1e-4)


def test_what_is_written_is_what_the_command_line_writes(
    client: httpx.Client, meshes: Path, ring: bytes, model_file: Path, tmp_path: Path
) -> None:
    out = tmp_path / "ring.glb"
    done = meshconv3d("explain", meshes / "ring.obj", "--model", model_file, "-o", out)
    assert done.returncode == 0
    headers = {"accept": "model/gltf-binary"}
    response = client.post("/v1/explain", files={"file": ("ring.obj", ring)}, headers=headers)
    assert response.content == out.read_bytes()


@pytest.mark.parametrize(
    ("query", "headers", "content", "status", "fault"),
    [
        ({"class": "cup"}, {}, None, 404, "unknown-class"),
        ({"model": "other"}, {}, None, 404, "not-found"),
        ({}, {"accept": "image/png"}, None, 406, "not-acceptable"),
        ({}, {}, b"", 400, "empty-file"),
        ({}, {}, b"v 0 0 0\nv 1 0 0\n", 422, "no-faces"),
    ],
)
def test_errors(
    client: httpx.Client,
    ring: bytes,
    query: dict,
    headers: dict,
    content: bytes | None,
    status: int,
    fault: str,
) -> None:
    body = ring if content is None else content
    response = client.post("/v1/explain", content=body, params=query, headers=headers)
    problem = response.json()
    assert (response.status_code, problem["fault"]) == (status, fault)
    assert response.headers["content-type"] == "application/problem+json"


def test_learned_pooling_is_refused_with_a_reason(
    start: Callable[..., Service], learned_file: Path, ring: bytes
) -> None:
    service = start("--model", str(learned_file), "--workers", "1")
    name = httpx.get(f"{service.url}/v1/models").json()["models"][1]["name"]
    response = httpx.post(f"{service.url}/v1/explain", content=ring, params={"model": name})
    assert (response.status_code, response.json()["fault"]) == (404, "learned-pooling")
    classified = httpx.post(
        f"{service.url}/v1/classify", content=ring, params={"model": name}, timeout=60
    )
    assert classified.status_code == 200
    service.stop()


def test_it_is_described(client: httpx.Client) -> None:
    description = client.get("/openapi.json").json()
    operation = description["paths"]["/v1/explain"]["post"]
    assert set(operation["responses"]["200"]["content"]) == set(OFFERED)
    assert {p["name"] for p in operation["parameters"]} == {"model", "class"}
    record = client.post(
        "/v1/explain",
        content=b"v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 3 2\nf 1 2 4\nf 1 4 3\nf 2 3 4\n",
        headers={"accept": "application/json"},
    ).json()
    schema = description["components"]["schemas"]
    assert set(schema["ExplainedAnswer"]["properties"]) == set(record)
    assert set(schema["Evidence"]["properties"]) == set(record["evidence"])
    assert json.dumps(record).count("NaN") == 0
