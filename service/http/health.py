"""Routes for the operator: probes and metrics."""

from fastapi import FastAPI, Request, Response
from fastapi.responses import JSONResponse
from prometheus_client.exposition import choose_encoder

from meshconv3d.service.http.dispatch import Dispatcher
from meshconv3d.service.http.openapi import NOT_READY, problem_responses
from meshconv3d.service.http.telemetry import Metrics


def add_health_routes(app: FastAPI, dispatcher: Dispatcher, metrics: Metrics) -> None:
    """Add /livez, /readyz and /metrics."""

    @app.get("/livez")
    async def live() -> dict:
        """The process runs."""
        return {"status": "alive"}

    @app.get("/readyz", responses=NOT_READY)
    async def ready() -> JSONResponse:
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
