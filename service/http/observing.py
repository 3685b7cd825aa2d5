"""Each request is given an id and a place in its trace; when it is over, a log line says how."""

import logging
import time
from collections.abc import Sequence

from starlette.datastructures import Headers
from starlette.routing import BaseRoute, Match
from starlette.types import ASGIApp, Message, Receive, Scope, Send

from meshconv3d.service.http.headers import DATA_POLICY
from meshconv3d.service.http.metrics import Metrics
from meshconv3d.service.http.notes import Notes

log = logging.getLogger(__name__)

# The route of what is none, in logs and metrics: paths as they come have no end.
NO_ROUTE = "none"


class Observed:
    """ASGI middleware: note what becomes of each request, and answer with its id and trace.

    routes: all that there are; app: what leads to them.
    """

    def __init__(self, app: ASGIApp, routes: Sequence[BaseRoute], metrics: Metrics) -> None:
        self.app = app
        self.routes = routes
        self.metrics = metrics

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        if scope["type"] != "http":
            await self.app(scope, receive, send)
            return
        started = time.perf_counter()
        came = dict(scope)  # on its way, the routes write into it what they made of it
        notes = Notes.begin(Headers(scope=scope))
        scope.setdefault("state", {})["notes"] = notes
        headers = [
            (b"x-request-id", notes.request_id.encode()),
            (b"traceparent", notes.trace.traceparent.encode()),
        ]
        status = 0

        async def noted_send(message: Message) -> None:
            nonlocal status
            if message["type"] == "http.response.start":
                status = message["status"]
                message["headers"] = [*message["headers"], *headers]
                if DATA_POLICY[0] not in dict(message["headers"]):
                    message["headers"].append(DATA_POLICY)
            await send(message)

        try:
            await self.app(scope, receive, noted_send)
        except Exception:
            # It was answered: all that the client learns is the id.
            log.exception("request %s failed", notes.request_id, extra=_ids(notes))
        finally:
            route = scope["route"].path if "route" in scope else self._route(came)
            self._close(scope["method"], route, notes, status, time.perf_counter() - started)

    def _close(self, method: str, route: str, notes: Notes, status: int, seconds: float) -> None:
        self.metrics.observe(route, status, seconds, notes)
        outcome = f"{status} {notes.fault}" if notes.fault else status
        log.info(
            "%s %s %s in %.1f ms",
            *(method, route, outcome, seconds * 1000),
            extra=_ids(notes)
            | {
                "method": method,
                "route": route,
                "status": status,
                "fault": notes.fault,
                "duration_ms": round(seconds * 1000, 1),
                "bytes": notes.received,
                "sha256": notes.contents,
            },
        )

    def _route(self, scope: Scope) -> str:
        """The route of a request as it came: a mount, or one that it did not come as far as."""
        for route in self.routes:
            match, found = route.matches(scope)
            if match is not Match.NONE:
                return getattr(found.get("route", route), "path", NO_ROUTE)
        return NO_ROUTE


def _ids(notes: Notes) -> dict[str, str]:
    return {
        "request_id": notes.request_id,
        "trace_id": notes.trace.trace,
        "span_id": notes.trace.span,
    }
