"""What those ask who look after the service."""

from fastapi import APIRouter, Request, Response
from fastapi.responses import JSONResponse
from prometheus_client.exposition import choose_encoder

from meshconv3d.service.http.description import problems
from meshconv3d.service.http.serving import Serving


def probe_routes(serving: Serving) -> APIRouter:
    """Whether it lives, whether it is ready, and what it counted."""
    router = APIRouter()

    @router.head("/livez", include_in_schema=False)
    @router.get("/livez")
    async def live() -> dict:
        """The process runs."""
        return {"status": "alive"}

    not_ready: dict[int | str, dict] = {503: {"description": "Not ready."}}

    @router.head("/readyz", include_in_schema=False)
    @router.get("/readyz", responses=not_ready)
    async def is_ready() -> JSONResponse:
        """There is a worker that has classified a known mesh as expected, and work is taken."""
        status = "ready" if serving.ready else "not ready"
        return JSONResponse({"status": status}, 200 if serving.ready else 503)

    @router.get(
        "/metrics",
        response_class=Response,
        responses={
            200: {
                "description": "Counters in the text format of Prometheus.",
                "content": {"text/plain": {"schema": {"type": "string"}}},
            },
            **problems(401),
        },
    )
    async def metrics(request: Request) -> Response:
        """What the service counted, for Prometheus."""
        encode, media_type = choose_encoder(request.headers.get("accept", ""))
        return Response(encode(serving.metrics.registry), headers={"content-type": media_type})

    return router
