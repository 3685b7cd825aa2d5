"""The Open Inference Protocol, version 2: the routes that inference servers have in common.

A tensor of n mesh files goes in, tensors of n results come out.
"""

import importlib.metadata
from collections.abc import Mapping, Sequence
from pathlib import PurePath

import numpy as np
from fastapi import FastAPI, Request, Response
from fastapi.responses import JSONResponse

from meshconv3d.model.errors import MeshError
from meshconv3d.model.loading import FORMATS
from meshconv3d.service.http.dispatch import Dispatcher
from meshconv3d.service.http.openapi import (
    INFERENCE_BODY,
    NOT_READY,
    WORK_ERRORS,
    InferenceAnswer,
    ModelMetadata,
    ModelReady,
    ServerLive,
    ServerMetadata,
    ServerReady,
    TensorMetadata,
    inference_errors,
)
from meshconv3d.service.http.problems import RequestError, request_error
from meshconv3d.service.http.tensors import JSON_LENGTH, Output, answer, malformed, read_request
from meshconv3d.service.http.uploads import BodyReader
from meshconv3d.service.models import ModelInfo
from meshconv3d.service.prediction import Prediction
from meshconv3d.service.workers import Task

# Of a longer name, only so many bytes at its end are looked at: they have its extension.
MAX_NAME_BYTES = 256

INPUTS = ({"name": "mesh", "datatype": "BYTES"}, {"name": "name", "datatype": "BYTES"})


def add_inference_routes(app: FastAPI, dispatcher: Dispatcher) -> None:
    """Add the routes of the protocol."""

    @app.get("/v2", responses=inference_errors(401))
    async def get_server_metadata() -> ServerMetadata:
        """The server, and the extensions of the protocol that it has."""
        version = importlib.metadata.version("meshconv3d")
        extensions = ["binary_tensor_data"]
        return ServerMetadata(name="meshconv3d", version=version, extensions=extensions)

    @app.get("/v2/health/live")
    async def get_server_liveness() -> ServerLive:
        """As /livez."""
        return ServerLive(live=True)

    @app.get("/v2/health/ready", response_model=ServerReady, responses=NOT_READY)
    async def get_server_readiness() -> JSONResponse:
        """As /readyz."""
        ready = dispatcher.ready
        return JSONResponse({"ready": ready}, 200 if ready else 503)

    @app.get("/v2/models/{name}", responses=inference_errors(401, 404))
    async def get_model_metadata(name: str) -> ModelMetadata:
        """The tensors of a model; -1 is any number."""
        return _metadata(dispatcher.model(name))

    @app.get(
        "/v2/models/{name}/ready",
        response_model=ModelReady,
        responses=inference_errors(401, 404) | NOT_READY,
    )
    async def get_model_readiness(name: str) -> JSONResponse:
        """Whether a model is ready: all are, or none."""
        dispatcher.model(name)
        ready = dispatcher.ready
        return JSONResponse({"name": name, "ready": ready}, 200 if ready else 503)

    @app.post(
        "/v2/models/{name}/infer",
        responses={
            200: {"model": InferenceAnswer, "content": {"application/octet-stream": {}}},
            **inference_errors(*WORK_ERRORS),
        },
        openapi_extra=INFERENCE_BODY,
    )
    async def infer(request: Request, name: str) -> Response:
        """Classify the meshes of a tensor, all or none: an error names the first that failed."""
        model = dispatcher.model(name)
        inference, tensors = await read_request(
            BodyReader(request, dispatcher.settings).read,
            request.headers.get(JSON_LENGTH),
            dispatcher.settings.max_request_meshes,
        )
        jobs = await dispatcher.submit(request, _tasks(name, tensors))
        predictions: list[Prediction] = []
        async for result in dispatcher.results(request, jobs):
            if isinstance(result, MeshError):
                error = request_error(result)
                detail = f"mesh[{len(predictions)}]: {error.fault}: {error}"
                raise RequestError(error.status, error.fault, detail)
            if isinstance(result, Exception):
                raise result
            predictions.append(result)
        body, json_length = answer(inference, name, _outputs(model, predictions))
        if json_length is None:
            return Response(body, media_type="application/json")
        headers = {JSON_LENGTH: str(json_length)}
        return Response(body, headers=headers, media_type="application/octet-stream")


def _metadata(model: ModelInfo) -> ModelMetadata:
    """The metadata of a model: its tensors are those of an empty answer."""
    outputs = [TensorMetadata(**output.describe()) for output in _outputs(model, []).values()]
    for output in outputs:
        output.shape = [n or -1 for n in output.shape]
    inputs = [TensorMetadata(**tensor, shape=[-1]) for tensor in INPUTS]
    return ModelMetadata(
        name=model.card.name, platform="meshconv3d", inputs=inputs, outputs=outputs
    )


def _tasks(model: str, tensors: Mapping[str, Sequence[bytes]]) -> list[Task]:
    """A task for each mesh of a request. Raises RequestError for other tensors."""
    names = [tensor["name"] for tensor in INPUTS]
    if "mesh" not in tensors or not set(tensors) <= set(names):
        found = ", ".join(tensors) or "none"
        raise malformed(f"the inputs are mesh and, if wanted, name, not {found}")
    contents = tensors["mesh"]
    declared = tensors.get("name", [b""] * len(contents))
    if len(declared) != len(contents):
        raise malformed(f"{len(contents)} meshes come with {len(declared)} names")
    return [
        Task(model, content, None, _declared(name[-MAX_NAME_BYTES:].decode(errors="replace")))
        for content, name in zip(contents, declared, strict=True)
    ]


def _declared(name: str) -> str | None:
    """The format that a name declares: its extension, or all of it where it is one."""
    return name if name.lower() in FORMATS else PurePath(name).suffix or None


def _outputs(model: ModelInfo, results: Sequence[Prediction]) -> dict[str, Output]:
    """The tensors of n results; `unknown` only if the model has a limit for it."""
    classes = model.card.config.classes
    shape = len(results), len(classes)
    scores = np.array([result.scores for result in results], np.float32)
    probabilities = np.array([result.probabilities for result in results], np.float32)
    outputs = [
        Output("scores", scores.reshape(shape)),
        Output("probabilities", probabilities.reshape(shape)),
        Output("class", np.array([result.label for result in results], np.str_)),
        Output("classes", np.array(classes, np.str_)),
    ]
    if model.card.calibration is not None:
        outputs.append(Output("unknown", np.array([result.unknown for result in results], bool)))
    return {output.name: output for output in outputs}
