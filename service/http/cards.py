"""What the service says of itself: its limits, and the cards of its models."""

from dataclasses import asdict

from fastapi import APIRouter

from meshconv3d.service.http.description import problems
from meshconv3d.service.http.serving import Serving


def card_routes(serving: Serving) -> APIRouter:
    """Limits and models."""
    router = APIRouter(prefix="/v1")

    @router.get("/limits", responses=problems(401))
    async def limits() -> dict:
        """The most that one upload may hold."""
        settings = serving.settings
        return {"upload_bytes": settings.max_upload_bytes, **asdict(settings.limits)}

    @router.get("/models", responses=problems(401))
    async def models() -> dict:
        """The models that are served, each with its card; the first is the default."""
        return {"models": [info.to_dict() for info in serving.pool.models.values()]}

    @router.get("/models/{name}", responses=problems(401, 404))
    async def model(name: str) -> dict:
        """The card of one model."""
        return serving.model(name).to_dict()

    return router
