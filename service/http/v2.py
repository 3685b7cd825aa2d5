"""The Open Inference Protocol, version 2: what inference servers have in common.

A tensor of n mesh files goes in, tensors of n results come out.
"""

import importlib.metadata
from collections.abc import Mapping, Sequence
from pathlib import PurePath
from typing import Any

import numpy as np
from fastapi import APIRouter, Request, Response
from fastapi.responses import JSONResponse

from meshconv3d.model.errors import MalformedFile, MeshError
from meshconv3d.model.loading import FORMATS
from meshconv3d.service.http.description import (
    INFERENCE_REQUEST,
    WORK_ERRORS,
    InferenceAnswer,
    inference_errors,
)
from meshconv3d.service.http.problems import STATUSES, problem
from meshconv3d.service.http.serving import Serving
from meshconv3d.service.http.tensors import JSON_LENGTH, Output, answer, read_request
from meshconv3d.service.http.uploads import BodyReader
from meshconv3d.service.models import ModelInfo
from meshconv3d.service.prediction import Prediction
from meshconv3d.service.workers import Task

INPUTS = ({"name": "mesh", "datatype": "BYTES"}, {"name": "name", "datatype": "BYTES"})


def v2_routes(serving: Serving) -> APIRouter:
    """The protocol's paths."""
    router = APIRouter(prefix="/v2")

    @router.get("", responses=inference_errors(401))
    async def server() -> dict:
        """The server, and which extensions of the protocol it knows."""
        version = importlib.metadata.version("meshconv3d")
        return {"name": "meshconv3d", "version": version, "extensions": ["binary_tensor_data"]}

    @router.get("/health/live")
    async def live() -> dict:
        """As /livez."""
        return {"live": True}

    not_ready: dict[int | str, dict] = {503: {"description": "Not ready."}}

    @router.get("/health/ready", responses=not_ready)
    async def ready() -> JSONResponse:
        """As /readyz."""
        return JSONResponse({"ready": serving.ready}, 200 if serving.ready else 503)

    @router.get("/models/{name}", responses=inference_errors(401, 404))
    async def model(name: str) -> dict:
        """The tensors of a model; -1 is any number."""
        return _metadata(serving.model(name))

    @router.get("/models/{name}/ready", responses=inference_errors(401, 404) | not_ready)
    async def model_ready(name: str) -> JSONResponse:
        """Whether a model is ready: all are, or none."""
        serving.model(name)
        return JSONResponse({"name": name, "ready": serving.ready}, 200 if serving.ready else 503)

    @router.post(
        "/models/{name}/infer",
        responses={
            200: {"model": InferenceAnswer, "content": {"application/octet-stream": {}}},
            **inference_errors(*WORK_ERRORS),
        },
        openapi_extra=INFERENCE_REQUEST,
    )
    async def infer(request: Request, name: str) -> Response:
        """Classify the meshes of a tensor, all or none: an error names the first that failed."""
        model = serving.model(name)
        inference, tensors = await read_request(
            BodyReader(request).read,
            request.headers.get(JSON_LENGTH),
            serving.settings.max_request_meshes,
        )
        jobs = await serving.submit(request, _tasks(name, tensors))
        predictions = []
        async for outcome in serving.outcomes(request, jobs):
            if isinstance(outcome, MeshError):
                detail = f"mesh[{len(predictions)}]: {outcome.fault}: {outcome}"
                return problem(request, STATUSES[type(outcome)], outcome.fault, detail)
            if isinstance(outcome, Exception):
                raise outcome
            predictions.append(outcome)
        body, json_length = answer(inference, name, _outputs(model, predictions))
        if json_length is None:
            return Response(body, media_type="application/json")
        headers = {JSON_LENGTH: str(json_length)}
        return Response(body, headers=headers, media_type="application/octet-stream")

    return router


def _metadata(model: ModelInfo) -> dict[str, Any]:
    """What a model's metadata says of its tensors, which are those of an empty answer."""
    outputs = [output.describe() for output in _outputs(model, []).values()]
    for output in outputs:
        output["shape"] = [n or -1 for n in output["shape"]]
    return {
        "name": model.card.name,
        "platform": "meshconv3d",
        "inputs": [tensor | {"shape": [-1]} for tensor in INPUTS],
        "outputs": outputs,
    }


def _tasks(model: str, tensors: Mapping[str, Sequence[bytes]]) -> list[Task]:
    """The work in the tensors of a request. Raises MalformedFile where they are others."""
    names = [tensor["name"] for tensor in INPUTS]
    if "mesh" not in tensors or not set(tensors) <= set(names):
        found = ", ".join(tensors) or "none"
        raise MalformedFile("bad-request", f"the inputs are mesh and, if wanted, name, not {found}")
    contents = tensors["mesh"]
    declared = tensors.get("name", [b""] * len(contents))
    if len(declared) != len(contents):
        raise MalformedFile(
            "bad-request", f"{len(contents)} meshes come with {len(declared)} names"
        )
    return [
        Task(model, content, None, _declared(name.decode(errors="replace")))
        for content, name in zip(contents, declared, strict=True)
    ]


def _declared(name: str) -> str | None:
    """What a name tells of the format: its extension, or all of it where it is one."""
    return name if name.lower() in FORMATS else PurePath(name).suffix or None


def _outputs(model: ModelInfo, results: Sequence[Prediction]) -> dict[str, Output]:
    """The tensors of n results. `unknown` is there if the model has a limit for it."""
    classes = model.card.config.classes
    shape = len(results), len(classes)
    scores = np.array([result.scores for result in results], np.float32).reshape(shape)
    probabilities = np.array([result.probabilities for result in results], np.float32)
    outputs = [
        Output("scores", scores),
        Output("probabilities", probabilities.reshape(shape)),
        Output("class", [result.label for result in results]),
        Output("classes", classes),
    ]
    if model.card.calibration is not None:
        outputs.append(Output("unknown", np.array([result.unknown for result in results], bool)))
    return {output.name: output for output in outputs}
