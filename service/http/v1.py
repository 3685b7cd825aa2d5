"""The service's own API: meshes in, records out."""

import asyncio
import hashlib
import logging
import re
from collections.abc import AsyncIterator, Sequence
from dataclasses import asdict, dataclass, replace
from typing import Annotated

from fastapi import FastAPI, Query, Request, Response
from fastapi.responses import FileResponse, JSONResponse, StreamingResponse
from pydantic import BaseModel
from starlette.requests import ClientDisconnect
from starlette.types import Receive, Scope, Send

from meshconv3d.model.loading import FORMATS, TABLE, FormatRow, Limits
from meshconv3d.model.samples import sample_paths
from meshconv3d.service.attribution import FORMS, explained_class
from meshconv3d.service.attribution.legend import ExplainedAnswer
from meshconv3d.service.http.context import context_of
from meshconv3d.service.http.dispatch import Dispatcher
from meshconv3d.service.http.openapi import (
    BINARY,
    FILE_BODY,
    FILES_BODY,
    WORK_ERRORS,
    problem_responses,
    reference,
)
from meshconv3d.service.http.problems import RequestError, request_error
from meshconv3d.service.http.uploads import Upload, read_upload, read_uploads
from meshconv3d.service.prediction import Failure, Prediction
from meshconv3d.service.records import Answer, record, to_json
from meshconv3d.service.workers import ExplanationOptions, Task, TaskFailed

log = logging.getLogger(__name__)

JSON_LINES = "application/x-ndjson"
# Entries of a header Accept that are looked at; browsers send some ten.
MAX_ACCEPTED = 100
# The forms of an explanation that are files.
COLOURED = [FORMS[name].media_type for name in ("glb", "ply")]

_NUMBER = re.compile(r"\d(\.\d{0,3})?")

# The name of the default stays out of the description, which needs no key.
ModelName = Annotated[
    str | None, Query(description="name of the model; by default the first of /v1/models")
]
Top = Annotated[int | None, Query(ge=1, description="only the N likeliest")]
ClassName = Annotated[
    str | None, Query(alias="class", description="class to explain; by default the likeliest")
]


class Formats(BaseModel):
    """The file formats that are known."""

    formats: list[FormatRow]


@dataclass(frozen=True, kw_only=True)
class UploadLimits(Limits):
    """The most that one upload may hold: its bytes, and what is in its files."""

    upload_bytes: int


class SampleFile(BaseModel):
    """A sample mesh of the package."""

    name: str
    file: str
    bytes: int


class Samples(BaseModel):
    """The sample meshes of the package."""

    samples: list[SampleFile]


MODEL_SCHEMA = reference("Model")
MODELS_SCHEMA = {
    "type": "object",
    "required": ["models"],
    "properties": {"models": {"type": "array", "items": MODEL_SCHEMA}},
}


def described(schema: dict) -> dict[int | str, dict]:
    """An answer in JSON that is described by a schema."""
    return {200: {"content": {"application/json": {"schema": schema}}}}


def add_v1_routes(app: FastAPI, dispatcher: Dispatcher) -> None:
    """Add the routes that classify, explain and describe."""

    @app.post(
        "/v1/classify",
        response_model=Answer,
        responses=problem_responses(*WORK_ERRORS),
        openapi_extra=FILE_BODY,
    )
    async def classify_mesh(request: Request, model: ModelName = None, top: Top = None) -> Response:
        """Classify one mesh: the form field `file`, or a raw body of a type that /v1/formats lists.

        A .gltf comes with its buffers in further fields `file`, or in a ZIP archive.
        """
        name = dispatcher.model(model).card.name
        upload = await read_upload(request, dispatcher.settings)
        prediction = await dispatcher.predict(request, task_of(upload, name))
        content = to_json(record(upload.name, prediction, top))
        return Response(content, media_type="application/json")

    @app.post(
        "/v1/classify/batch",
        response_class=StreamingResponse,
        responses={
            200: {
                "description": "A line of JSON for each file, in order: an Answer, or a Refusal.",
                "content": {
                    # OpenAPI 3.2 has `itemSchema` for a line; 3.1 has nothing for it.
                    JSON_LINES: {
                        "schema": BINARY,
                        "x-itemSchema": {"anyOf": [reference("Answer"), reference("Refusal")]},
                    }
                },
            },
            **problem_responses(*WORK_ERRORS),
        },
        openapi_extra=FILES_BODY,
    )
    async def classify_batch(
        request: Request, model: ModelName = None, top: Top = None
    ) -> Response:
        """Classify several meshes: the form fields `file`, and each mesh in ZIP archives. Each is
        answered by a line as soon as it and those before it are done; one that cannot be classified
        says why in its line. Buffers of a .gltf come in fields `file`, too."""
        name = dispatcher.model(model).card.name
        uploads = await read_uploads(request, dispatcher.settings)
        tasks = [task_of(upload, name) for upload in uploads if upload.error is None]
        results = dispatcher.results(request, await dispatcher.submit(request, tasks))
        return _Lines(_lines(uploads, results, top), media_type=JSON_LINES)

    @app.post(
        "/v1/explain",
        response_model=ExplainedAnswer,
        responses={
            200: {"content": {media_type: {"schema": BINARY} for media_type in COLOURED}},
            **problem_responses(406, *WORK_ERRORS),
        },
        openapi_extra=FILE_BODY,
    )
    async def explain_mesh(
        request: Request, model: ModelName = None, label: ClassName = None
    ) -> Response:
        """Explain what each face of one mesh adds to the score of a class.

        The header Accept chooses: the numbers as JSON (the default), or the mesh in colours, as
        GLB or PLY.
        """
        card = dispatcher.model(model).card
        explained_class(card.config.classes, card.config.pooling, label)
        form = _acceptable_form(request)
        upload = await read_upload(request, dispatcher.settings)
        task = replace(task_of(upload, card.name), explanation=ExplanationOptions(form, label))
        prediction = await dispatcher.predict(request, task)
        headers = {"vary": "accept"}
        return Response(prediction.explanation, 200, headers, FORMS[form].media_type)

    @app.get("/v1/formats", responses=problem_responses(401))
    async def list_formats() -> Formats:
        """The file formats that are read, and those for which an extra is missing."""
        return Formats(formats=[known.row for known in TABLE.values()])

    @app.get("/v1/limits", responses=problem_responses(401))
    async def get_limits() -> UploadLimits:
        """The most that one upload may hold."""
        settings = dispatcher.settings
        return UploadLimits(upload_bytes=settings.max_upload_bytes, **asdict(settings.limits))

    @app.get("/v1/models", responses=described(MODELS_SCHEMA) | problem_responses(401))
    async def list_models(request: Request) -> Response:
        """The models that are served, each with its card; the first is the default."""
        models = [info.to_dict() for info in dispatcher.pool.models.values()]
        return _tagged(request, {"models": models})

    @app.get("/v1/models/{name}", responses=described(MODEL_SCHEMA) | problem_responses(401, 404))
    async def get_model(request: Request, name: str) -> Response:
        """The card of one model."""
        return _tagged(request, dispatcher.model(name).to_dict())

    @app.get("/v1/samples", responses=problem_responses(401))
    async def list_samples() -> Samples:
        """The sample meshes in the package."""
        files = [
            SampleFile(name=name, file=path.name, bytes=path.stat().st_size)
            for name, path in sample_paths().items()
        ]
        return Samples(samples=files)

    @app.get(
        "/v1/samples/{file}", responses=problem_responses(401, 404), response_class=FileResponse
    )
    async def get_sample(file: str) -> FileResponse:
        """One sample mesh."""
        found = {path.name: path for path in sample_paths().values()}
        if file not in found:
            detail = f"no sample {file!r}, but {', '.join(found)}"
            raise RequestError(404, "not-found", detail)
        path = found[file]
        return FileResponse(path, media_type=FORMATS[path.suffix[1:]].media_types[0])


def task_of(upload: Upload, model: str) -> Task:
    return Task(model, upload.content, upload.name, upload.declared, pieces=upload.pieces)


def _tagged(request: Request, content: dict) -> Response:
    """JSON with an entity tag; without its body for a client that has it already."""
    answer = JSONResponse(content)
    tag = f'"{hashlib.sha256(answer.body).hexdigest()[:32]}"'
    headers = {"etag": tag, "cache-control": "no-cache"}
    if request.headers.get("if-none-match") == tag:
        return Response(status_code=304, headers=headers)
    answer.headers.update(headers)
    return answer


class _Lines(StreamingResponse):
    """Lines that are sent one by one until the client has gone."""

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        try:
            await self.stream_response(send)
        except ClientDisconnect:
            context_of(Request(scope)).fault = "client-gone"


async def _lines(
    uploads: Sequence[Upload],
    results: AsyncIterator[Prediction | Exception],
    top: int | None,
) -> AsyncIterator[bytes]:
    """The records as JSON Lines, each with the name of its file."""
    for upload in uploads:
        result = upload.error or await anext(results)
        if isinstance(result, Exception):
            if isinstance(result, TaskFailed):
                log.error("one mesh of a batch failed: %s", result)
            error = request_error(result)
            result = Failure(error.fault, str(error))
        yield to_json(record(upload.name, result, top)) + b"\n"
        await asyncio.sleep(0)  # other requests have their turn, where many results are there


def _acceptable_form(request: Request) -> str:
    """The form of an explanation that the request prefers, the earlier of equals; JSON where it
    takes any. Raises RequestError."""
    by_type = {FORMS[name].media_type: name for name in ("json", "glb", "ply")}
    media_type = preferred(request.headers.get("accept", ""), list(by_type))
    if media_type is None:
        detail = f"explanations come as {', '.join(by_type)}"
        raise RequestError(406, "not-acceptable", detail)
    return by_type[media_type]


def preferred(accept: str, offered: Sequence[str]) -> str | None:
    """The media type of `offered` that an Accept header prefers; the earlier one of equals.

    None if it accepts none of them. An empty header accepts all.
    """
    qualities: dict[str, float] = {}
    entries = (accept.strip() or "*/*").lower().replace(" ", "").split(",", MAX_ACCEPTED)
    for entry in entries[:MAX_ACCEPTED]:
        media_range, *parameters = entry.split(";")
        quality = next((p[2:] for p in parameters if p.startswith("q=")), "1")
        qualities[media_range] = float(quality) if _NUMBER.fullmatch(quality) else 0.0

    def quality_of(media_type: str) -> float:
        """That of the most exact range which matches."""
        ranges = (media_type, media_type.partition("/")[0] + "/*", "*/*")
        return next((qualities[name] for name in ranges if name in qualities), 0.0)

    best = max(offered, key=quality_of)
    return best if quality_of(best) > 0 else None
