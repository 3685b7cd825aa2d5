"""The app: the routes, and what a request passes on its way to them."""

import importlib.metadata
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from typing import Any

from fastapi import FastAPI
from starlette.middleware.cors import CORSMiddleware
from starlette.types import ASGIApp

from meshconv3d.service.http import page
from meshconv3d.service.http.admission import Admission
from meshconv3d.service.http.cards import card_routes
from meshconv3d.service.http.description import INFERENCE_SCHEMAS
from meshconv3d.service.http.gate import Gate
from meshconv3d.service.http.keys import Keyed, describe_keys
from meshconv3d.service.http.metrics import Metrics
from meshconv3d.service.http.observing import Observed
from meshconv3d.service.http.probes import probe_routes
from meshconv3d.service.http.problems import install_problem_handlers
from meshconv3d.service.http.refusing import Refusing
from meshconv3d.service.http.serving import Serving
from meshconv3d.service.http.v1 import v1_routes
from meshconv3d.service.http.v2 import v2_routes
from meshconv3d.service.settings import Settings
from meshconv3d.service.workers import WorkerPool

# What a page of a named origin may send, and what it may see of an answer.
CORS_REQUEST_HEADERS = (
    *("authorization", "content-type", "inference-header-content-length"),
    *("traceparent", "x-api-key"),
)
CORS_ANSWER_HEADERS = (
    *("inference-header-content-length", "retry-after", "traceparent", "x-request-id"),
)


def create_app(pool: WorkerPool, admission: Admission, settings: Settings) -> ASGIApp:
    """The service over workers that are warm."""
    serving = Serving(pool, admission, settings, Metrics(pool, admission))
    routes = _Api(settings, pool)
    install_problem_handlers(routes)
    served = [of(serving) for of in (v1_routes, card_routes, v2_routes, probe_routes)]
    for router in (*served, page.router):
        # Included, they would be in lists of their own, and the app's would not tell of them.
        routes.router.routes += router.routes
    routes.mount("/assets", page.Assets())
    app: ASGIApp = Gate(routes, admission, settings)
    if settings.api_keys:
        app = Keyed(app, settings.api_keys)
    app = Refusing(app)
    if settings.cors_origins:
        app = CORSMiddleware(
            app,
            allow_origins=settings.cors_origins,
            allow_methods=("GET", "POST"),
            allow_headers=CORS_REQUEST_HEADERS,
            expose_headers=CORS_ANSWER_HEADERS,
        )
    return Observed(app, routes.routes, serving.metrics)


class _Api(FastAPI):
    """The routes, and their description."""

    def __init__(self, settings: Settings, pool: WorkerPool) -> None:
        @asynccontextmanager
        async def at_work(_: FastAPI) -> AsyncIterator[None]:
            pool.attach()
            yield
            pool.close()
            await pool.wait_closed()

        super().__init__(
            lifespan=at_work,
            title="MeshConv3D",
            summary="What is this 3D mesh?",
            version=importlib.metadata.version("meshconv3d"),
            # These pages would load their scripts from a public server.
            docs_url=None,
            redoc_url=None,
            redirect_slashes=False,
        )
        self._keyed = bool(settings.api_keys)

    def openapi(self) -> dict[str, Any]:
        if self.openapi_schema is None:
            description = super().openapi()  # which it keeps
            description["components"]["schemas"] |= INFERENCE_SCHEMAS
            if self._keyed:
                describe_keys(description)
        return super().openapi()
