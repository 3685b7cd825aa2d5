"""What every request passes first: it gets a name, and if it brings work, bounds."""

import asyncio
import time
import uuid

from starlette.requests import Request
from starlette.types import ASGIApp, Message, Receive, Scope, Send

from service.http.admission import Admission, Full
from service.http.problems import UploadTooLarge, UploadTooSlow, full
from service.settings import Settings


class RequestId:
    """ASGI middleware: give each request an id, which its answer and its log lines carry."""

    def __init__(self, app: ASGIApp) -> None:
        self.app = app

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        if scope["type"] != "http":
            await self.app(scope, receive, send)
            return
        name = uuid.uuid4().hex
        scope.setdefault("state", {})["request_id"] = name
        header = (b"x-request-id", name.encode())

        async def named_send(message: Message) -> None:
            if message["type"] == "http.response.start":
                message["headers"] = [*message["headers"], header]
            await send(message)

        await self.app(scope, receive, named_send)


class Gate:
    """ASGI middleware: bound what a POST may bring, all that are under way together, and its time.

    A request counts as work once its body is there, so that a slow upload takes no one's place;
    its bytes count as they come. `request.state.expires` is its deadline, on the monotonic clock.
    """

    def __init__(self, app: ASGIApp, admission: Admission, settings: Settings) -> None:
        self.app = app
        self.admission = admission
        self.settings = settings

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        if scope["type"] != "http" or scope["method"] != "POST":
            await self.app(scope, receive, send)
            return
        try:
            self.admission.arrive()
        except Full as error:
            response = await full(Request(scope), error)
            await response(scope, receive, send)
            return
        visit = _Visit(scope, receive, self.admission, self.settings)
        scope["state"]["expires"] = visit.expires
        try:
            await self.app(scope, visit.receive, send)
        finally:
            visit.end()


class _Visit:
    """One request on its way through the gate."""

    def __init__(
        self, scope: Scope, receive: Receive, admission: Admission, settings: Settings
    ) -> None:
        self.expires = time.monotonic() + settings.deadline_seconds
        self._receive = receive
        self._admission = admission
        self._settings = settings
        self._limit = settings.max_upload_bytes
        self._claimed = dict(scope["headers"]).get(b"content-length", b"0")
        self._held = 0
        self._entered = False

    async def receive(self) -> Message:
        """The next message of the body, unless there is a reason to stop reading.

        Raises UploadTooLarge, UploadTooSlow or Full.
        """
        if self._entered:
            return await self._receive()
        if self._claimed.isdigit() and int(self._claimed) > self._limit:
            raise UploadTooLarge(self._limit)  # without waiting for any of it
        try:
            async with asyncio.timeout(self.expires - time.monotonic()):
                message = await self._receive()
        except TimeoutError:
            raise UploadTooSlow(self._settings.deadline_seconds) from None
        count = len(message.get("body", b""))
        self._admission.hold(count)
        self._held += count
        if self._held > self._limit:
            raise UploadTooLarge(self._limit)
        if message["type"] == "http.request" and not message.get("more_body", False):
            self._admission.enter()
            self._entered = True
        return message

    def end(self) -> None:
        """Give back what the request held."""
        self._admission.release(self._held)
        if self._entered:
            self._admission.leave()
        self._admission.depart()
