"""The service's own API: meshes in, records out."""

import logging
from collections.abc import AsyncIterator, Sequence
from dataclasses import asdict

from fastapi import APIRouter, HTTPException, Query, Request, Response
from fastapi.responses import StreamingResponse
from starlette.requests import ClientDisconnect
from starlette.types import Receive, Scope, Send

from service.evidence import FORMS, explained_class
from service.evidence.records import ExplainedAnswer
from service.http.description import BINARY, FILE_BODY, FILES_BODY, WORK_ERRORS, problems
from service.http.negotiation import preferred
from service.http.notes import notes_of
from service.http.problems import reason
from service.http.serving import Outcome, Serving
from service.http.uploads import Upload, read_upload, read_uploads
from service.records import Answer, Refusal
from service.workers import Record, TaskFailed, Wanted, Work

log = logging.getLogger(__name__)

JSON_LINES = "application/x-ndjson"
# The forms of an explanation that are files.
COLOURED = [FORMS[name].media_type for name in ("glb", "ply")]


def v1_routes(serving: Serving) -> APIRouter:
    """Classify one mesh or several; what models there are."""
    router = APIRouter(prefix="/v1")
    # What the default is called stands behind a key: not in the description, then.
    model_name = Query(
        default_factory=lambda: serving.default_model,
        description="name of the model; by default the first of /v1/models",
    )
    top_classes = Query(None, ge=1, description="only the N likeliest")

    @router.post(
        "/classify",
        response_model=Answer,
        responses=problems(*WORK_ERRORS),
        openapi_extra={"requestBody": FILE_BODY},
    )
    async def classify(
        request: Request, model: str = model_name, top: int | None = top_classes
    ) -> Response:
        """Classify one mesh: the form field `file`, or a raw body with a model media type."""
        serving.card(model)
        upload = await read_upload(request)
        record = await serving.record(request, _work(upload, model, top))
        return Response(record.content, media_type="application/json")

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
        openapi_extra={"requestBody": FILES_BODY},
    )
    async def classify_batch(
        request: Request, model: str = model_name, top: int | None = top_classes
    ) -> Response:
        """Classify several meshes: the form fields `file`. Each is answered by a line as soon as it
        and those before it are done; one that cannot be classified says why in its line."""
        serving.card(model)
        uploads = await read_uploads(request, serving.settings.max_request_meshes)
        futures = await serving.submit(request, [_work(upload, model, top) for upload in uploads])
        names = [upload.name for upload in uploads]
        lines = _lines(names, serving.outcomes(request, futures))
        return _Lines(lines, media_type=JSON_LINES)

    @router.post(
        "/explain",
        response_model=ExplainedAnswer,
        responses={
            200: {"content": {media_type: {"schema": BINARY} for media_type in COLOURED}},
            **problems(406, *WORK_ERRORS),
        },
        openapi_extra={"requestBody": FILE_BODY},
    )
    async def explain(
        request: Request,
        model: str = model_name,
        class_: str | None = Query(
            None, alias="class", description="class to explain; by default the likeliest"
        ),
    ) -> Response:
        """Say what each face of one mesh adds to the score of a class.

        The header Accept chooses: the mesh in colours, as GLB (the default) or PLY, or the numbers
        as JSON.
        """
        config = serving.card(model)["config"]
        explained_class(config["classes"], config["pooling"], class_)
        form = _acceptable_form(request)
        upload = await read_upload(request)
        wanted = Wanted(form, class_)
        work = Work(model, upload.content, upload.name, upload.declared, wanted=wanted)
        record = await serving.record(request, work)
        headers = {"vary": "accept"}
        return Response(record.content, media_type=FORMS[form].media_type, headers=headers)

    @router.get("/limits", responses=problems(401))
    async def limits() -> dict:
        """The most that one upload may hold."""
        settings = serving.settings
        return {"upload_bytes": settings.max_upload_bytes, **asdict(settings.limits)}

    @router.get("/models", responses=problems(401))
    async def models() -> dict:
        """The models that are served, each with its card; the first is the default."""
        return {"models": list(serving.pool.models.values())}

    @router.get("/models/{name}", responses=problems(401, 404))
    async def model(name: str) -> dict:
        """The card of one model."""
        return serving.card(name)

    return router


def _acceptable_form(request: Request) -> str:
    """The form that the request would like best. Raises HTTPException."""
    by_type = {form.media_type: name for name, form in FORMS.items()}
    media_type = preferred(request.headers.get("accept", ""), list(by_type))
    if media_type is None:
        raise HTTPException(406, f"explanations come as {', '.join(by_type)}")
    return by_type[media_type]


def _work(upload: Upload, model: str, top: int | None) -> Work:
    return Work(model, upload.content, upload.name, upload.declared, top)


class _Lines(StreamingResponse):
    """Lines that are sent one by one, as long as there is somebody to take them."""

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        try:
            await self.stream_response(send)
        except ClientDisconnect:
            notes_of(Request(scope)).fault = "client-gone"


async def _lines(
    names: Sequence[str | None], outcomes: AsyncIterator[Outcome]
) -> AsyncIterator[bytes]:
    """The outcomes as JSON Lines, each file's under its name."""
    remaining = iter(names)
    async for outcome in outcomes:
        yield _line(next(remaining), outcome) + b"\n"


def _line(name: str | None, outcome: Outcome) -> bytes:
    if isinstance(outcome, Record):
        return outcome.content
    if isinstance(outcome, TaskFailed):
        log.error("one mesh of a batch failed: %s", outcome)
    return Refusal(file=name, error=reason(outcome)).model_dump_json().encode()
