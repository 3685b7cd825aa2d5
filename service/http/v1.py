"""The service's own API: meshes in, records out."""

import logging
from collections.abc import AsyncIterator, Sequence

from fastapi import APIRouter, HTTPException, Request, Response
from fastapi.responses import StreamingResponse
from starlette.requests import ClientDisconnect
from starlette.types import Receive, Scope, Send

from meshconv3d.service.attribution import FORMS, explained_class
from meshconv3d.service.attribution.legend import ExplainedAnswer
from meshconv3d.service.http.description import BINARY, FILE_BODY, FILES_BODY, WORK_ERRORS, problems
from meshconv3d.service.http.direct import Asked, AskedWhy, DirectRoute, described, read_query
from meshconv3d.service.http.negotiation import preferred
from meshconv3d.service.http.notes import notes_of
from meshconv3d.service.http.problems import reason
from meshconv3d.service.http.serving import Outcome, Serving
from meshconv3d.service.http.uploads import Upload, read_upload, read_uploads
from meshconv3d.service.records import Answer, record, to_json
from meshconv3d.service.workers import ExplanationOptions, Task, TaskFailed

log = logging.getLogger(__name__)

JSON_LINES = "application/x-ndjson"
# The forms of an explanation that are files.
COLOURED = [FORMS[name].media_type for name in ("glb", "ply")]


def v1_routes(serving: Serving) -> APIRouter:
    """Classify one mesh or several, and explain one."""
    router = APIRouter(prefix="/v1", route_class=DirectRoute)

    @router.post(
        "/classify",
        response_model=Answer,
        responses=problems(*WORK_ERRORS),
        openapi_extra=described(Asked, FILE_BODY),
    )
    async def classify(request: Request) -> Response:
        """Classify one mesh: the form field `file`, or a raw body with a model media type."""
        asked = read_query(request, Asked)
        model = serving.model(asked.model).card.name
        upload = await read_upload(request)
        prediction = await serving.predict(request, _task(upload, model))
        content = to_json(record(upload.name, prediction, asked.top))
        return Response(content, media_type="application/json")

    @router.post(
        "/classify/batch",
        response_class=StreamingResponse,
        responses={
            200: {
                "description": "A line for each file, in order: an Answer, or a Refusal.",
                "content": {JSON_LINES: {"schema": {"type": "string"}}},
            },
            **problems(*WORK_ERRORS),
        },
        openapi_extra=described(Asked, FILES_BODY),
    )
    async def classify_batch(request: Request) -> Response:
        """Classify several meshes: the form fields `file`. Each is answered by a line as soon as it
        and those before it are done; one that cannot be classified says why in its line."""
        asked = read_query(request, Asked)
        model = serving.model(asked.model).card.name
        uploads = await read_uploads(request, serving.settings.max_request_meshes)
        tasks = [_task(upload, model) for upload in uploads]
        jobs = await serving.submit(request, tasks)
        names = [upload.name for upload in uploads]
        lines = _lines(names, serving.outcomes(request, jobs), asked.top)
        return _Lines(lines, media_type=JSON_LINES)

    @router.post(
        "/explain",
        response_model=ExplainedAnswer,
        responses={
            200: {"content": {media_type: {"schema": BINARY} for media_type in COLOURED}},
            **problems(406, *WORK_ERRORS),
        },
        openapi_extra=described(AskedWhy, FILE_BODY),
    )
    async def explain(request: Request) -> Response:
        """Say what each face of one mesh adds to the score of a class.

        The header Accept chooses: the mesh in colours, as GLB (the default) or PLY, or the numbers
        as JSON.
        """
        asked = read_query(request, AskedWhy)
        card = serving.model(asked.model).card
        explained_class(card.config.classes, card.config.pooling, asked.label)
        form = _acceptable_form(request)
        upload = await read_upload(request)
        options = ExplanationOptions(form, asked.label)
        task = Task(card.name, upload.content, upload.name, upload.declared, options)
        prediction = await serving.predict(request, task)
        headers = {"vary": "accept"}
        return Response(prediction.explanation, media_type=FORMS[form].media_type, headers=headers)

    return router


def _acceptable_form(request: Request) -> str:
    """The form that the request would like best. Raises HTTPException."""
    by_type = {form.media_type: name for name, form in FORMS.items()}
    media_type = preferred(request.headers.get("accept", ""), list(by_type))
    if media_type is None:
        raise HTTPException(406, f"explanations come as {', '.join(by_type)}")
    return by_type[media_type]


def _task(upload: Upload, model: str) -> Task:
    return Task(model, upload.content, upload.name, upload.declared)


class _Lines(StreamingResponse):
    """Lines that are sent one by one, as long as there is somebody to take them."""

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        try:
            await self.stream_response(send)
        except ClientDisconnect:
            notes_of(Request(scope)).fault = "client-gone"


async def _lines(
    names: Sequence[str | None], outcomes: AsyncIterator[Outcome], top: int | None
) -> AsyncIterator[bytes]:
    """The outcomes as JSON Lines, each file's under its name."""
    remaining = iter(names)
    async for outcome in outcomes:
        yield _line(next(remaining), outcome, top) + b"\n"


def _line(name: str | None, outcome: Outcome, top: int | None) -> bytes:
    if isinstance(outcome, TaskFailed):
        log.error("one mesh of a batch failed: %s", outcome)
    result = reason(outcome) if isinstance(outcome, Exception) else outcome
    return to_json(record(name, result, top))
