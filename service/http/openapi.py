"""The parts of the OpenAPI description that FastAPI cannot derive: bodies that are read by hand, to
bound them, error answers, and API keys."""

from typing import Any

import msgspec
from fastapi.routing import APIRoute
from pydantic import BaseModel, TypeAdapter

from meshconv3d.export.metadata import ModelCard
from meshconv3d.service.http.access import OPEN_PATHS
from meshconv3d.service.http.problems import PROBLEM_JSON, Problem
from meshconv3d.service.http.tensors import JSON_LENGTH, InferenceRequest
from meshconv3d.service.records import Refusal

BINARY = {"type": "string", "format": "binary"}
SCHEMAS = "#/components/schemas/"
NOT_READY: dict[int | str, dict] = {503: {"description": "Not ready."}}


def reference(name: str) -> dict[str, str]:
    """A schema of the description, by its name."""
    return {"$ref": SCHEMAS + name}


def _body(**content: dict) -> dict:
    described = {media_type: {"schema": schema} for media_type, schema in content.items()}
    return {"requestBody": {"required": True, "content": described}}


def _form(file: dict) -> dict:
    return {"type": "object", "required": ["file"], "properties": {"file": file}}


# The media types of all formats, which /v1/formats lists, would each be a body of its own.
FILE_BODY = _body(**{"multipart/form-data": _form(BINARY), "application/octet-stream": BINARY})
FILES_BODY = _body(
    **{"multipart/form-data": _form({"type": "array", "items": BINARY, "minItems": 1})}
)

_, INFERENCE_SCHEMAS = msgspec.json.schema_components(
    [InferenceRequest], ref_template=SCHEMAS + "{name}"
)
INFERENCE_BODY = {
    "parameters": [
        {
            "name": JSON_LENGTH,
            "in": "header",
            "description": "Bytes of the body that are JSON, where binary data follows.",
            "schema": {"type": "integer", "minimum": 0},
        }
    ],
    **_body(
        **{
            "application/json": reference("InferenceRequest"),
            "application/octet-stream": BINARY,
        }
    ),
}

_ERRORS = {
    400: "The request or the file is malformed.",
    401: "The API key is missing or wrong.",
    403: "The request comes from a page of another site.",
    404: "There is no such thing here.",
    406: "There is no form that the client accepts.",
    408: "The body did not arrive in time.",
    413: "The body is larger, or the file holds more, than the service accepts.",
    415: "The format is not one that is read, or contradicts the content.",
    422: "The file holds no mesh that can be classified, or cannot be read within bounds.",
    503: "There is too much to do; the header Retry-After says when to try again.",
    504: "There was no answer in time.",
}
# Errors of requests that bring meshes.
WORK_ERRORS = (400, 401, 403, 404, 408, 413, 415, 422, 503, 504)


class InferenceError(BaseModel):
    """An error in the form of the inference protocol."""

    error: str


class OutputTensor(BaseModel):
    """A tensor of an answer in JSON."""

    name: str
    datatype: str
    shape: list[int]
    data: list[float] | list[bool] | list[str]


class InferenceAnswer(BaseModel):
    """An answer of the inference protocol in JSON."""

    model_name: str
    id: str | None = None
    outputs: list[OutputTensor]


class ServerMetadata(BaseModel):
    """The server, and the extensions of the protocol that it has."""

    name: str
    version: str
    extensions: list[str]


class ServerLive(BaseModel):
    """Whether the server runs."""

    live: bool


class ServerReady(BaseModel):
    """Whether the server takes work."""

    ready: bool


class ModelReady(ServerReady):
    """Whether a model takes work."""

    name: str


class TensorMetadata(BaseModel):
    """A tensor; -1 in its shape is any number."""

    name: str
    datatype: str
    shape: list[int]


class ModelMetadata(BaseModel):
    """The tensors of a model."""

    name: str
    platform: str
    inputs: list[TensorMetadata]
    outputs: list[TensorMetadata]


def problem_responses(*statuses: int) -> dict[int | str, dict]:
    """Statuses that are answered with a problem document."""
    return _responses(statuses, PROBLEM_JSON, Problem.__name__)


def inference_errors(*statuses: int) -> dict[int | str, dict]:
    """Statuses that are answered in the form of the inference protocol."""
    return _responses(statuses, "application/json", InferenceError.__name__)


def _responses(statuses: tuple[int, ...], media_type: str, schema: str) -> dict[int | str, dict]:
    content = {media_type: {"schema": reference(schema)}}
    return {status: {"description": _ERRORS[status], "content": content} for status in statuses}


def operation_id(route: APIRoute) -> str:
    """The name of a route's function in camel case: classifyMesh."""
    first, *others = route.name.split("_")
    return first + "".join(map(str.title, others))


def _tag(path: str, method: str) -> str:
    """The heading under which the description has an operation."""
    if path.startswith("/v2"):
        return "Open Inference Protocol"
    if path.startswith("/v1"):
        return "Meshes" if method == "post" else "What is served"
    return "Operation"


def _model_schemas() -> dict[str, Any]:
    """The schema of a served model: its card, and the hash of its file."""
    card = TypeAdapter(ModelCard).json_schema(
        mode="serialization", ref_template=SCHEMAS + "{model}"
    )
    schemas = card.pop("$defs")
    card["title"] = "Model"
    for name, kind in (("preparation", "object"), ("sha256", "string")):
        card["properties"][name] = {"type": kind}
        card["required"].append(name)
    return schemas | {"Model": card}


def complete(description: dict[str, Any], keyed: bool) -> dict[str, Any]:
    """Add to FastAPI's description of the app what it does not know. keyed: whether requests need
    an API key."""
    # Relative to where the description lies, under whatever path a proxy puts the service.
    description["servers"] = [{"url": "."}]
    for path, operations in description["paths"].items():
        for method, operation in operations.items():
            operation["tags"] = [_tag(path, method)]
    schemas = description["components"]["schemas"]
    schemas |= INFERENCE_SCHEMAS | _model_schemas()
    for kind in (Problem, InferenceError, Refusal):
        schema = kind.model_json_schema(ref_template=SCHEMAS + "{model}")
        schemas |= schema.pop("$defs", {}) | {kind.__name__: schema}
    if keyed:
        schemes = {
            "key": {"type": "apiKey", "in": "header", "name": "X-API-Key"},
            "bearer": {"type": "http", "scheme": "bearer"},
        }
        description["components"]["securitySchemes"] = schemes
        description["security"] = [{name: []} for name in schemes]
        for path in OPEN_PATHS & set(description["paths"]):
            for operation in description["paths"][path].values():
                operation["security"] = []
    return description
