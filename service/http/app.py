"""The routes. All that they do is to hand bytes in and records out."""

import importlib.metadata
import uuid
from collections.abc import AsyncIterator, Awaitable, Callable
from contextlib import asynccontextmanager

import anyio
import anyio.to_thread
from fastapi import FastAPI, HTTPException, Query, Request, Response
from fastapi.responses import JSONResponse

from model.loading import FORMATS
from service.classifier import Classifier
from service.http.problems import RESPONSES, install_problem_handlers
from service.http.uploads import BodyLimit, read_upload
from service.records import Answer, answer
from service.settings import Settings

# The body of POST /v1/classify, which is read by hand to bound it, as OpenAPI describes it.
_BINARY = {"schema": {"type": "string", "format": "binary"}}
REQUEST_BODY = {
    "required": True,
    "content": {
        "multipart/form-data": {
            "schema": {
                "type": "object",
                "required": ["file"],
                "properties": {"file": {"type": "string", "format": "binary"}},
            }
        },
        "application/octet-stream": _BINARY,
        **{known.media_types[0]: _BINARY for known in FORMATS.values()},
    },
}


def create_app(classifier: Classifier, settings: Settings) -> FastAPI:
    """The service around one classifier, which has passed its self-test."""
    ready = False

    @asynccontextmanager
    async def lifespan(_: FastAPI) -> AsyncIterator[None]:
        nonlocal ready
        ready = True
        yield
        ready = False

    app = FastAPI(
        title="MeshConv3D",
        summary="What is this 3D mesh?",
        version=importlib.metadata.version("meshconv3d"),
        lifespan=lifespan,
        # These pages would load their scripts from a public server.
        docs_url=None,
        redoc_url=None,
        redirect_slashes=False,
    )
    app.add_middleware(BodyLimit, limit=settings.max_upload_bytes)
    install_problem_handlers(app)
    workers = anyio.CapacityLimiter(settings.workers)

    @app.middleware("http")
    async def name_request(
        request: Request, call_next: Callable[[Request], Awaitable[Response]]
    ) -> Response:
        request.state.request_id = uuid.uuid4().hex
        response = await call_next(request)
        response.headers["x-request-id"] = request.state.request_id
        return response

    @app.post(
        "/v1/classify",
        response_model=Answer,
        responses={status: RESPONSES[status] for status in (400, 413, 415, 422)},
        openapi_extra={"requestBody": REQUEST_BODY},
    )
    async def classify(
        request: Request, top: int | None = Query(None, ge=1, description="only the N likeliest")
    ) -> Answer:
        """Classify one mesh: the form field `file`, or a raw body with a model media type."""
        upload = await read_upload(request)
        result = await anyio.to_thread.run_sync(
            classifier.classify, upload.content, upload.declared, limiter=workers
        )
        return answer(upload.name, result, top)

    @app.get("/v1/models")
    async def models() -> dict:
        """The models that are served, each with its card."""
        return {"models": [classifier.model.describe()]}

    @app.get("/v1/models/{name}", responses={404: RESPONSES[404]})
    async def model(name: str) -> dict:
        """The card of one model."""
        if name != classifier.model.card.name:
            raise HTTPException(
                404, f"no model {name!r} is served here, but {classifier.model.card.name}"
            )
        return classifier.model.describe()

    @app.api_route("/livez", methods=["GET", "HEAD"])
    async def live() -> dict:
        """The process runs."""
        return {"status": "alive"}

    not_ready: dict[int | str, dict] = {503: {"description": "Not ready."}}

    @app.api_route("/readyz", methods=["GET", "HEAD"], responses=not_ready)
    async def is_ready() -> JSONResponse:
        """A known mesh was classified as expected since the start."""
        status = "ready" if ready else "not ready"
        return JSONResponse({"status": status}, 200 if ready else 503)

    return app
