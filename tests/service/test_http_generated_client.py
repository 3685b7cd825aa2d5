"""A client that is generated from the service's description calls every route."""

import importlib
import inspect
import os
import re
import subprocess
import sys
from io import BytesIO
from pathlib import Path
from types import ModuleType
from typing import Any

import pytest

from meshconv3d.model.samples import sample_paths
from tests.service.conftest import Service

GENERATOR = [sys.executable, "-m", "openapi_python_client"]


# Lines of JSON are bytes to this generator.
SETTINGS = "content_type_overrides:\n  application/x-ndjson: application/octet-stream\n"


@pytest.fixture(scope="module")
def generated(service: Service, tmp_path_factory: pytest.TempPathFactory) -> ModuleType:
    """The package of the client; generating it gave no warning."""
    folder = tmp_path_factory.mktemp("generated")
    (folder / "settings.yaml").write_text(SETTINGS)
    description = ["--url", f"{service.url}/openapi.json", "--config", folder / "settings.yaml"]
    written = ["--output-path", folder / "generated_client", "--meta", "none"]
    done = subprocess.run(
        [*GENERATOR, "generate", *description, *written, "--fail-on-warning"],
        capture_output=True,
        text=True,
        env=os.environ | {"PATH": f"{Path(sys.executable).parent}:{os.environ['PATH']}"},  # ruff
    )
    assert done.returncode == 0, done.stdout + done.stderr
    assert "arning" not in done.stdout + done.stderr
    sys.path.insert(0, str(folder))
    return importlib.import_module("generated_client")


def test_every_route_answers_a_generated_client(
    generated: ModuleType, service: Service, meshes: Path
) -> None:
    client = generated.Client(base_url=service.url)
    description = client.get_httpx_client().get("/openapi.json").json()
    operations = [o for path in description["paths"].values() for o in path.values()]
    content = (meshes / "ring.obj").read_bytes()
    model = client.get_httpx_client().get("/v1/models").json()["models"][0]["name"]
    given = {"name": model, "file": next(iter(sample_paths().values())).name}
    for operation in operations:
        call = route(generated, operation)
        wanted = inspect.signature(call).parameters
        arguments = {key: value for key, value in given.items() if key in wanted}
        if "body" in wanted:
            arguments["body"] = body(generated, operation, content)
        response = call(client=client, **arguments)
        name = operation["operationId"]
        # This service has no library.
        assert response.status_code == (404 if name == "findSimilar" else 200), name
        if "json" in response.headers["content-type"] and "ndjson" not in name:
            assert response.parsed is not None, name


def route(generated: ModuleType, operation: dict) -> Any:
    """The function of the client for an operation."""
    tag, name = (
        re.sub(r"(?<=[a-z])(?=[A-Z])| ", "_", text).lower()
        for text in (operation["tags"][0], operation["operationId"])
    )
    module = importlib.import_module(f"{generated.__name__}.api.{tag}.{name}")
    return module.sync_detailed


def body(generated: ModuleType, operation: dict, content: bytes) -> Any:
    """A mesh in the form that the operation takes."""
    models = importlib.import_module(f"{generated.__name__}.models")
    types = importlib.import_module(f"{generated.__name__}.types")
    file = types.File(BytesIO(content), file_name="ring.obj")
    match operation["operationId"]:
        case "infer":
            given = {"name": "mesh", "datatype": "BYTES", "shape": [1], "data": [content.decode()]}
            return models.InferenceRequest.from_dict({"inputs": [given]})
        case "classifyBatch":
            return models.ClassifyBatchBody(file=[file, file])
        case _:
            return file
