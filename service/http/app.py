"""The routes. All that they do is to hand bytes in and records out."""

import importlib.metadata
from dataclasses import asdict

from fastapi import FastAPI, HTTPException, Query, Request, Response
from fastapi.responses import JSONResponse
from starlette.types import ASGIApp

from model.loading import FORMATS
from service.evidence import FORMS, explained_class
from service.evidence.records import ExplainedAnswer
from service.http import page
from service.http.admission import Admission
from service.http.gate import Gate, RequestId
from service.http.negotiation import preferred
from service.http.problems import RESPONSES, install_problem_handlers
from service.http.uploads import read_upload
from service.http.waiting import result_of
from service.records import Answer
from service.settings import Settings
from service.workers import Wanted, Work, WorkerPool

# The body of POST /v1/classify, which is read by hand to bound it, as OpenAPI describes it.
BINARY = {"schema": {"type": "string", "format": "binary"}}
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
        "application/octet-stream": BINARY,
        **{known.media_types[0]: BINARY for known in FORMATS.values()},
    },
}

COLOURED = [form for form in FORMS.values() if form.media_type != "application/json"]


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
        return Response(record.content, media_type="application/json")

    @app.post(
        "/v1/explain",
        response_model=ExplainedAnswer,
        responses={
            200: {"content": {form.media_type: BINARY for form in COLOURED}},
            **{s: RESPONSES[s] for s in (400, 404, 406, 408, 413, 415, 422, 503, 504)},
        },
        openapi_extra={"requestBody": REQUEST_BODY},
    )
    async def explain(
        request: Request,
        model: str = Query(default_model, description="name of the model"),
        class_: str | None = Query(
            None, alias="class", description="class to explain; by default the likeliest"
        ),
    ) -> Response:
        """Say what each face of one mesh adds to the score of a class.

        The header Accept chooses: the mesh in colours, as GLB (the default) or PLY, or the numbers
        as JSON.
        """
        config = served(model)["config"]
        explained_class(config["classes"], config["pooling"], class_)
        form = _acceptable_form(request)
        upload = await read_upload(request)
        wanted = Wanted(form, class_)
        work = Work(model, upload.content, upload.name, upload.declared, wanted=wanted)
        expires = request.state.expires
        record = await result_of(pool.submit(work, expires), expires, request)
        headers = {"vary": "accept"}
        return Response(record.content, media_type=FORMS[form].media_type, headers=headers)

    @app.get("/v1/limits")
    async def limits() -> dict:
        """The most that one upload may hold."""
        return {"upload_bytes": settings.max_upload_bytes, **asdict(settings.limits)}

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

    app.include_router(page.router)
    app.mount("/assets", page.Assets())
    return RequestId(Gate(app, admission, settings))


def _acceptable_form(request: Request) -> str:
    """The form that the request would like best. Raises HTTPException."""
    by_type = {form.media_type: name for name, form in FORMS.items()}
    media_type = preferred(request.headers.get("accept", ""), list(by_type))
    if media_type is None:
        raise HTTPException(406, f"explanations come as {', '.join(by_type)}")
    return by_type[media_type]
