"""The web page."""

from pathlib import Path
from typing import Any

from fastapi import FastAPI, Response
from fastapi.responses import FileResponse
from starlette.staticfiles import StaticFiles

# Built from `page/`; the name of every file in `assets` changes with its content.
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


def add_page(app: FastAPI) -> None:
    """Add the page and its assets."""

    @app.get("/", include_in_schema=False)
    async def page() -> FileResponse:
        """The page: never cached, since its name stays while its assets' names change."""
        return FileResponse(BUILT / "index.html", headers={**HEADERS, "cache-control": "no-cache"})

    app.mount("/assets", _Assets())


class _Assets(StaticFiles):
    """Scripts and styles of the page, which never change under their names."""

    def __init__(self) -> None:
        super().__init__(directory=BUILT / "assets")

    def file_response(self, *args: Any, **options: Any) -> Response:
        response = super().file_response(*args, **options)
        lasting = {"cache-control": "public, max-age=31536000, immutable"}
        response.headers.update(HEADERS | lasting)
        return response
