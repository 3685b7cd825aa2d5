"""The page for people, and the sample meshes that it offers."""

from pathlib import Path

from fastapi import APIRouter, HTTPException
from fastapi.responses import FileResponse
from starlette.staticfiles import StaticFiles
from starlette.types import Message, Receive, Scope, Send

from meshconv3d.model.loading import FORMATS
from meshconv3d.model.samples import sample_paths
from meshconv3d.service.http.description import problems

# Built from `page/`; every file in `assets` has a name that changes with its content.
BUILT = Path(__file__).parents[1] / "page"

HEADERS = {
    "content-security-policy": "; ".join(
        (
            "default-src 'none'",
            "script-src 'self'",
            "worker-src 'self'",
            "style-src 'self'",
            "img-src 'self' data:",
            "connect-src 'self' data:",  # glTF has buffers in such addresses
            "base-uri 'none'",
            "form-action 'none'",
            "frame-ancestors 'none'",
        )
    ),
    "cross-origin-opener-policy": "same-origin",
}

router = APIRouter()


@router.api_route("/", methods=["GET", "HEAD"], include_in_schema=False)
async def page() -> FileResponse:
    """The page: asked for anew each time, since its name stays while its assets' change."""
    return FileResponse(BUILT / "index.html", headers={**HEADERS, "cache-control": "no-cache"})


@router.get("/v1/samples", responses=problems(401))
async def samples() -> dict:
    """The sample meshes in the package, one of each class that they show."""
    return {
        "samples": [
            {"class": name, "file": path.name, "bytes": path.stat().st_size}
            for name, path in sample_paths().items()
        ]
    }


@router.get("/v1/samples/{file}", responses=problems(401, 404), response_class=FileResponse)
async def sample(file: str) -> FileResponse:
    """One sample mesh."""
    found = {path.name: path for path in sample_paths().values()}
    if file not in found:
        raise HTTPException(404, f"no sample {file!r}, but {', '.join(found)}")
    path = found[file]
    return FileResponse(path, media_type=FORMATS[path.suffix[1:]].media_types[0])


class Assets(StaticFiles):
    """Scripts and styles of the page, which never change under their names."""

    def __init__(self) -> None:
        super().__init__(directory=BUILT / "assets")

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        lasting = {**HEADERS, "cache-control": "public, max-age=31536000, immutable"}
        extra = [(name.encode(), value.encode()) for name, value in lasting.items()]

        async def send_lasting(message: Message) -> None:
            if message["type"] == "http.response.start":
                message["headers"] = [*message["headers"], *extra]
            await send(message)

        await super().__call__(scope, receive, send_lasting)
