"""What the API's description says of bodies and errors that the routes handle by themselves."""

import msgspec
from pydantic import BaseModel

from meshconv3d.model.loading import FORMATS
from meshconv3d.service.http.problems import PROBLEM_JSON, Problem
from meshconv3d.service.http.tensors import JSON_LENGTH, InferenceRequest

BINARY = {"type": "string", "format": "binary"}


def _form(file: dict) -> dict:
    schema = {"type": "object", "required": ["file"], "properties": {"file": file}}
    return {"multipart/form-data": {"schema": schema}}


# Bodies are read by hand, to bound them.
FILE_BODY = {
    "required": True,
    "content": {
        **_form(BINARY),
        "application/octet-stream": {"schema": BINARY},
        **{known.media_types[0]: {"schema": BINARY} for known in FORMATS.values()},
    },
}
FILES_BODY = {"required": True, "content": _form({"type": "array", "items": BINARY, "minItems": 1})}

# The JSON of an infer request, and its two forms.
_, INFERENCE_SCHEMAS = msgspec.json.schema_components(
    [InferenceRequest], ref_template="#/components/schemas/{name}"
)
INFERENCE_REQUEST = {
    "parameters": [
        {
            "name": JSON_LENGTH,
            "in": "header",
            "description": "Bytes of the body that are JSON, where binary data follows.",
            "schema": {"type": "integer", "minimum": 0},
        }
    ],
    "requestBody": {
        "required": True,
        "content": {
            "application/json": {"schema": {"$ref": "#/components/schemas/InferenceRequest"}},
            "application/octet-stream": {"schema": BINARY},
        },
    },
}

_ERRORS = {
    400: "The request or the file is malformed.",
    401: "The API key is missing or wrong.",
    404: "There is no such thing here.",
    406: "There is no form that the client accepts.",
    408: "The body did not arrive in time.",
    413: "The body is larger, or the file holds more, than the service accepts.",
    415: "The format is not one that is read, or contradicts the content.",
    422: "The file holds no mesh that can be classified, or cannot be read within bounds.",
    503: "There is too much to do; the header Retry-After says when to try again.",
    504: "There was no answer in time.",
}
# What may come of a request that brings meshes.
WORK_ERRORS = (400, 401, 404, 408, 413, 415, 422, 503, 504)


class InferenceError(BaseModel):
    """An error as the inference protocol has it."""

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


def problems(*statuses: int) -> dict[int | str, dict]:
    """Statuses that are answered with a problem document."""
    return _described(statuses, PROBLEM_JSON, Problem.model_json_schema())


def inference_errors(*statuses: int) -> dict[int | str, dict]:
    """Statuses that are answered as the inference protocol wants it."""
    return _described(statuses, "application/json", InferenceError.model_json_schema())


def _described(statuses: tuple[int, ...], media_type: str, schema: dict) -> dict[int | str, dict]:
    content = {media_type: {"schema": schema}}
    return {status: {"description": _ERRORS[status], "content": content} for status in statuses}
