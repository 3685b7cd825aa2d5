"""What the service says of itself."""

import json
from pathlib import Path

import httpx

from tests.commands import meshconv3d


def test_probes(client: httpx.Client) -> None:
    assert client.get("/livez").json() == {"status": "alive"}
    ready = client.get("/readyz")
    assert (ready.status_code, ready.json()) == (200, {"status": "ready"})


def test_models_are_listed_with_their_cards(client: httpx.Client, model_file: Path) -> None:
    card = json.loads(meshconv3d("inspect", model_file, "--json").stdout)
    assert client.get("/v1/models").json() == {"models": [card]}


def test_a_model_tells_of_itself_by_its_name(client: httpx.Client) -> None:
    (card,) = client.get("/v1/models").json()["models"]
    assert client.get(f"/v1/models/{card['name']}").json() == card
    missing = client.get("/v1/models/other")
    assert (missing.status_code, missing.json()["fault"]) == (404, "not-found")
    assert missing.json()["detail"] == f"no model 'other' is served here, but {card['name']}"


def test_both_request_forms_are_described(client: httpx.Client) -> None:
    body = operation(client)["requestBody"]
    assert body["required"]
    form = body["content"]["multipart/form-data"]["schema"]
    assert form["required"] == ["file"]
    assert form["properties"]["file"] == {"type": "string", "format": "binary"}
    assert set(body["content"]) == {"multipart/form-data", "application/octet-stream"}


def test_problems_are_described_as_they_come(client: httpx.Client) -> None:
    responses = operation(client)["responses"]
    assert set(responses) == {
        "200",
        *["400", "401", "403", "404", "408", "413", "415", "422", "503", "504"],
    }
    problem = client.post("/v1/classify", content=b"").json()
    schema = client.get("/openapi.json").json()["components"]["schemas"]["Problem"]
    for status in set(responses) - {"200"}:
        (media_type,) = responses[status]["content"]
        assert media_type == "application/problem+json"
        assert responses[status]["content"][media_type]["schema"] == {
            "$ref": "#/components/schemas/Problem"
        }
        assert set(problem) <= set(schema["properties"])
        assert set(schema["required"]) <= set(problem)


def test_the_answer_is_described_as_it_comes(client: httpx.Client, meshes: Path) -> None:
    schemas = client.get("/openapi.json").json()["components"]["schemas"]
    record = client.post("/v1/classify", content=(meshes / "ring.obj").read_bytes()).json()
    for part, name in (
        (record, "Answer"),
        (record["scores"][0], "ClassScore"),
        (record["model"], "ModelId"),
        (record["mesh"], "MeshReport"),
    ):
        assert set(part) == set(schemas[name]["properties"]) >= set(schemas[name]["required"])


def operation(client: httpx.Client) -> dict:
    return client.get("/openapi.json").json()["paths"]["/v1/classify"]["post"]


def test_a_card_is_sent_once_to_who_keeps_it(client: httpx.Client) -> None:
    for path in ("/v1/models", "/v1/models/tiny"):
        first = client.get(path)
        again = client.get(path, headers={"if-none-match": first.headers["etag"]})
        assert (first.status_code, again.status_code, again.content) == (200, 304, b"")
        assert first.headers["cache-control"] == "no-cache"
        assert client.get(path, headers={"if-none-match": '"other"'}).content == first.content
