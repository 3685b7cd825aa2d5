"""The parts of the OpenAPI description that FastAPI cannot derive: bodies that are read by hand, to
bound them, error answers, and API keys."""

from typing import Any

import msgspec
from pydantic import BaseModel

from meshconv3d.model.loading import FORMATS
from meshconv3d.service.http.access import OPEN_PATHS
from meshconv3d.service.http.problems import PROBLEM_JSON, Problem
from meshconv3d.service.http.tensors import JSON_LENGTH, InferenceRequest

BINARY = {"type": "string", "format": "binary"}
NOT_READY: dict[int | str, dict] = {503: {"description": "Not ready."}}


def _body(**content: dict) -> dict:
    described = {media_type: {"schema": schema} for media_type, schema in content.items()}
    return {"requestBody": {"required": True, "content": described}}


def _form(file: dict) -> dict:
    return {"type": "object", "required": ["file"], "properties": {"file": file}}


_MEDIA_TYPES = ("application/octet-stream", *(known.media_types[0] for known in FORMATS.values()))
FILE_BODY = _body(**{"multipart/form-data": _form(BINARY)}, **dict.fromkeys(_MEDIA_TYPES, BINARY))
FILES_BODY = _body(
    **{"multipart/form-data": _form({"type": "array", "items": BINARY, "minItems": 1})}
)

_, INFERENCE_SCHEMAS = msgspec.json.schema_components(
    [InferenceRequest], ref_template="#/components/schemas/{name}"
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
            "application/json": {"$ref": "#/components/schemas/InferenceRequest"},
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


def problem_responses(*statuses: int) -> dict[int | str, dict]:
    """Statuses that are answered with a problem document."""
    return _responses(statuses, PROBLEM_JSON, Problem)


def inference_errors(*statuses: int) -> dict[int | str, dict]:
    """Statuses that are answered in the form of the inference protocol."""
    return _responses(statuses, "application/json", InferenceError)


def _responses(
    statuses: tuple[int, ...], media_type: str, model: type[BaseModel]
) -> dict[int | str, dict]:
    content = {media_type: {"schema": model.model_json_schema()}}
    return {status: {"description": _ERRORS[status], "content": content} for status in statuses}


def complete(description: dict[str, Any], keyed: bool) -> dict[str, Any]:
    """Add to FastAPI's description of the app what it does not know. keyed: whether requests need
    an API key."""
    description["components"]["schemas"] |= INFERENCE_SCHEMAS
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
