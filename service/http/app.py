"""The routes. All that they do is to hand bytes in and records out."""

import importlib.metadata

from fastapi import FastAPI, HTTPException, Query, Request, Response
from fastapi.responses import JSONResponse
from starlette.types import ASGIApp

from model.loading import FORMATS
from service.http.admission import Admission
from service.http.gate import Gate, RequestId
from service.http.problems import RESPONSES, install_problem_handlers
from service.http.uploads import read_upload
from service.http.waiting import result_of
from service.records import Answer
from service.settings import Settings
from service.workers import Work, WorkerPool

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


def create_app(pool: WorkerPool, admission: Admission, settings: Settings) -> ASGIApp:
    """The service over workers that are warm."""
    app = FastAPI(
        title="MeshConv3D",
        summary="What is this 3D mesh?",
        version=importlib.metadata.version("meshconv3d"),
        # These pages would load their scripts from a public server.
        docs_url=None,
        redoc_url=None,
        redirect_slashes=False,
    )
    install_problem_handlers(app)
    default_model = next(iter(pool.models))

    def served(name: str) -> dict:
        """The card of a model that is served. Raises HTTPException."""
        if name not in pool.models:
            names = ", ".join(pool.models)
            raise HTTPException(404, f"no model {name!r} is served here, but {names}")
        return pool.models[name]

    @app.post(
        "/v1/classify",
        response_model=Answer,
        responses={s: RESPONSES[s] for s in (400, 404, 408, 413, 415, 422, 503, 504)},
        openapi_extra={"requestBody": REQUEST_BODY},
    )
    async def classify(
        request: Request,
        model: str = Query(default_model, description="name of the model"),
        top: int | None = Query(None, ge=1, description="only the N likeliest"),
    ) -> Response:
        """Classify one mesh: the form field `file`, or a raw body with a model media type."""
        served(model)
        upload = await read_upload(request)
        work = Work(model, upload.content, upload.name, upload.declared, top)
        expires = request.state.expires
        record = await result_of(pool.submit(work, expires), expires, request)
        return Response(record.json, media_type="application/json")

    @app.get("/v1/models")
    async def models() -> dict:
        """The models that are served, each with its card; the first is the default."""
        return {"models": list(pool.models.values())}

    @app.get("/v1/models/{name}", responses={404: RESPONSES[404]})
    async def model(name: str) -> dict:
        """The card of one model."""
        return served(name)

    @app.api_route("/livez", methods=["GET", "HEAD"])
    async def live() -> dict:
        """The process runs."""
        return {"status": "alive"}

    not_ready: dict[int | str, dict] = {503: {"description": "Not ready."}}

    @app.api_route("/readyz", methods=["GET", "HEAD"], responses=not_ready)
    async def is_ready() -> JSONResponse:
        """There is a worker that has classified a known mesh as expected, and work is taken."""
        ready = pool.alive > 0 and admission.open
        return JSONResponse({"status": "ready" if ready else "not ready"}, 200 if ready else 503)

    return RequestId(Gate(app, admission, settings))
