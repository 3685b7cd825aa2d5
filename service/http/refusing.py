"""What a connection does not take is answered as everything else is: told why, counted, logged."""

from starlette.requests import Request
from starlette.types import ASGIApp, Receive, Scope, Send

from meshconv3d.service.http.admission import Full
from meshconv3d.service.http.errors import Unreadable
from meshconv3d.service.http.keys import OPEN_PATHS
from meshconv3d.service.http.problems import full, unreadable

# Why a request is not taken, if it is not. Of a body that breaks on its way, it comes later.
Refusal = Full | Unreadable


def crowded(most: int) -> Full:
    """Why a connection is not served where so many are."""
    # Not its pause, too: that would hold the connection.
    return Full(f"{most} connections are open", retry_after=1, pause=0.0)


def refusal_of(scope: Scope) -> Refusal | None:
    """Why the connection of a request does not take it."""
    return scope["state"].get("refusal")


class Refusing:
    """ASGI middleware: give the refusal where a connection left one.

    However many connections there are, the probes are answered: a service is not to be ended for
    being asked a lot.
    """

    def __init__(self, app: ASGIApp) -> None:
        self.app = app

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        refusal = refusal_of(scope)
        if isinstance(refusal, Unreadable):
            await unreadable(Request(scope), refusal)(scope, receive, send)
        elif refusal is not None and scope["path"] not in OPEN_PATHS:
            response = await full(Request(scope), refusal)
            await response(scope, receive, send)
        else:
            await self.app(scope, receive, send)
