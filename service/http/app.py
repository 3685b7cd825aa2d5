"""The app: its routes, its page, and the middleware before them."""

import asyncio
import importlib.metadata
import time
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any

from fastapi import FastAPI, Response
from fastapi.responses import FileResponse
from starlette.concurrency import run_in_threadpool
from starlette.middleware.cors import CORSMiddleware
from starlette.staticfiles import StaticFiles
from starlette.types import ASGIApp, Message, Receive, Scope, Send

from meshconv3d.service.http.admission import Admission, AdmissionMiddleware
from meshconv3d.service.http.dispatch import Dispatcher
from meshconv3d.service.http.health import add_health_routes
from meshconv3d.service.http.oip import add_inference_routes
from meshconv3d.service.http.openapi import complete, operation_id
from meshconv3d.service.http.problems import install_problem_handlers
from meshconv3d.service.http.search import add_search_routes
from meshconv3d.service.http.telemetry import Metrics, TelemetryMiddleware
from meshconv3d.service.http.v1 import add_v1_routes
from meshconv3d.service.settings import Settings
from meshconv3d.service.workers import WorkerPool

if TYPE_CHECKING:
    from meshconv3d.service.library import Library

# Time to answer what a stop has cancelled, in seconds.
CLOSE_SECONDS = 1.0

# Headers that pages of a named origin may send, and may read.
CORS_REQUEST_HEADERS = (
    *("authorization", "content-type", "inference-header-content-length"),
    *("traceparent", "x-api-key"),
)
CORS_ANSWER_HEADERS = (
    *("inference-header-content-length", "retry-after", "traceparent", "x-request-id"),
)

# Built from `page/`; the name of every file in `assets` changes with its content.
PAGE = Path(__file__).parents[1] / "page"

# Of the page's content security policy, what also holds without a service (`service.static_page`).
PAGE_POLICY = (
    "default-src 'none'",
    "script-src 'self'",
    "worker-src 'self'",
    "style-src 'self'",
    "img-src 'self' data:",
    "connect-src 'self' data:",  # glTF has buffers in such addresses
    "base-uri 'none'",
    "form-action 'none'",
)
PAGE_HEADERS = {
    "content-security-policy": "; ".join((*PAGE_POLICY, "frame-ancestors 'none'")),
    "cross-origin-opener-policy": "same-origin",
}


def create_app(
    pool: WorkerPool, admission: Admission, settings: Settings, library: "Library | None" = None
) -> ASGIApp:
    """The app over workers that are warm. library: what /v1/similar searches in."""
    dispatcher, metrics = Dispatcher(pool, admission, settings), Metrics(pool, admission)
    routes = _Routes(pool, admission, keyed=bool(settings.api_keys))
    install_problem_handlers(routes)
    add_v1_routes(routes, dispatcher)
    add_search_routes(routes, dispatcher, library)
    add_inference_routes(routes, dispatcher)
    add_health_routes(routes, dispatcher, metrics)
    add_page(routes)
    app: ASGIApp = AdmissionMiddleware(routes, admission, settings)
    if settings.cors_origins:
        app = CORSMiddleware(
            app,
            allow_origins=settings.cors_origins,
            allow_methods=("GET", "POST"),
            allow_headers=CORS_REQUEST_HEADERS,
            expose_headers=CORS_ANSWER_HEADERS,
        )
    return TelemetryMiddleware(app, routes.routes, metrics)


class _Routes(FastAPI):
    """The routes and their description. At the end, the workers are closed."""

    def __init__(self, pool: WorkerPool, admission: Admission, keyed: bool) -> None:
        @asynccontextmanager
        async def lifespan(_: FastAPI) -> AsyncIterator[None]:
            # The description, which is kept, takes 0.1 s, and the first thread 30 ms, since its
            # libraries are imported then: no request should cost the others that.
            await run_in_threadpool(self.openapi)
            yield
            pool.close()
            # Requests whose work that cancelled are still to be answered.
            end = time.monotonic() + CLOSE_SECONDS
            while not admission.idle and time.monotonic() < end:
                await asyncio.sleep(0.01)

        super().__init__(
            lifespan=lifespan,
            title="MeshConv3D",
            summary="What is this 3D mesh?",
            version=importlib.metadata.version("meshconv3d"),
            generate_unique_id_function=operation_id,
            # These pages would load their scripts from a public server; /docs is our own.
            docs_url=None,
            redoc_url=None,
            redirect_slashes=False,
        )
        self._keyed = keyed

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Answer a request; HEAD as GET, without the body."""

        async def send_head(message: Message) -> None:
            if message["type"] == "http.response.start":
                await send(message)
                await send({"type": "http.response.body"})

        if scope.get("method") == "HEAD":
            await super().__call__({**scope, "method": "GET"}, receive, send_head)
        else:
            await super().__call__(scope, receive, send)

    def openapi(self) -> dict[str, Any]:
        if self.openapi_schema is None:
            self.openapi_schema = complete(super().openapi(), self._keyed)
        return self.openapi_schema


def add_page(app: FastAPI) -> None:
    """Add the pages and their assets."""

    @app.get("/", include_in_schema=False)
    async def page() -> FileResponse:
        """The page to classify with."""
        return _page("index.html")

    @app.get("/docs", include_in_schema=False)
    async def docs() -> FileResponse:
        """The API to read and to try, of its description."""
        return _page("docs.html")

    app.mount("/assets", _Assets())


def _page(name: str) -> FileResponse:
    """A page: never cached, since its name stays while its assets' names change."""
    return FileResponse(PAGE / name, headers={**PAGE_HEADERS, "cache-control": "no-cache"})


class _Assets(StaticFiles):
    """Scripts and styles of the page, which never change under their names."""

    def __init__(self) -> None:
        super().__init__(directory=PAGE / "assets")

    def file_response(self, *args: Any, **options: Any) -> Response:
        response = super().file_response(*args, **options)
        lasting = {"cache-control": "public, max-age=31536000, immutable"}
        response.headers.update(PAGE_HEADERS | lasting)
        return response
