"""Routes for the operator: probes and metrics."""

from fastapi import FastAPI, Request, Response
from fastapi.responses import JSONResponse
from prometheus_client.exposition import choose_encoder
from pydantic import BaseModel

from meshconv3d.service.http.dispatch import Dispatcher
from meshconv3d.service.http.openapi import NOT_READY, problem_responses
from meshconv3d.service.http.telemetry import Metrics


class Status(BaseModel):
    """State of the service."""

    status: str


def add_health_routes(app: FastAPI, dispatcher: Dispatcher, metrics: Metrics) -> None:
    """Add /livez, /readyz and /metrics."""

    @app.get("/livez")
    async def get_liveness() -> Status:
        """The process runs."""
        return Status(status="alive")

    @app.get("/readyz", response_model=Status, responses=NOT_READY)
    async def get_readiness() -> JSONResponse:
        """A worker has classified a known mesh as expected, and work is admitted."""
        status = "ready" if dispatcher.ready else "not ready"
        return JSONResponse({"status": status}, 200 if dispatcher.ready else 503)

    @app.get(
        "/metrics",
        response_class=Response,
        responses={
            200: {
                "description": "Counters in the text format of Prometheus.",
                "content": {"text/plain": {"schema": {"type": "string"}}},
            },
            **problem_responses(401),
        },
    )
    async def get_metrics(request: Request) -> Response:
        """Counters of the service, for Prometheus."""
        encode, media_type = choose_encoder(request.headers.get("accept", ""))
        return Response(encode(metrics.registry), headers={"content-type": media_type})
