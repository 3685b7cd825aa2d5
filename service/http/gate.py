"""What every request that brings work passes first, and what bounds it."""

import asyncio
import time

from starlette.requests import Request
from starlette.types import ASGIApp, Message, Receive, Scope, Send

from meshconv3d.service.http.admission import Admission, Full
from meshconv3d.service.http.errors import UploadTooLarge, UploadTooSlow
from meshconv3d.service.http.notes import Notes
from meshconv3d.service.http.problems import full
from meshconv3d.service.http.refusing import refusal_of
from meshconv3d.service.settings import Settings
from meshconv3d.service.workers import Job


class Gate:
    """ASGI middleware: bound what a POST may bring, all that are under way together, and its time.

    A request counts as work once its body is there, so that a slow upload takes no one's place;
    its bytes count as they come. `request.state.visit` is its `Visit`.
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
        visit = Visit(scope, receive, self.admission, self.settings)
        scope["state"]["visit"] = visit
        try:
            await self.app(scope, visit.receive, send)
        finally:
            visit.end()


class Visit:
    """One request on its way through the gate.

    expires: its deadline, on the monotonic clock. jobs: the work that it has in the pool.
    """

    def __init__(
        self, scope: Scope, receive: Receive, admission: Admission, settings: Settings
    ) -> None:
        self._began = time.monotonic()
        self.expires = self._began + settings.deadline_seconds
        self._scope = scope
        self._receive = receive
        self._admission = admission
        self._settings = settings
        self._limit = settings.max_upload_bytes
        self._claimed = dict(scope["headers"]).get(b"content-length", b"0")
        self._notes: Notes = scope["state"]["notes"]
        self.jobs: list[Job] = []
        self._complete = False
        self._meshes = 0

    async def receive(self) -> Message:
        """The next message of the body, unless there is a reason to stop reading.

        Raises UploadTooLarge, UploadTooSlow, Unreadable or Full.
        """
        if self._complete:
            return await self._receive()
        if self._claimed.isdigit() and int(self._claimed) > self._limit:
            raise UploadTooLarge(self._limit)  # without waiting for any of it
        try:
            async with asyncio.timeout(self.expires - time.monotonic()):
                message = await self._receive()
        except TimeoutError:
            raise UploadTooSlow(self._settings.deadline_seconds) from None
        if (refusal := refusal_of(self._scope)) is not None:
            raise refusal
        count = len(message.get("body", b""))
        self._admission.hold(count)
        self._notes.received += count
        if self._notes.received > self._limit:
            raise UploadTooLarge(self._limit)
        if message["type"] == "http.request" and not message.get("more_body", False):
            self._complete = True
            self._notes.stages.append(("upload", time.monotonic() - self._began))
            self.take_on(1)
        return message

    def take_on(self, count: int) -> None:
        """Have so many meshes counted in: one for a complete body, then all that are in it.

        Raises Full.
        """
        if count > self._meshes:
            self._admission.enter(count - self._meshes)
            self._meshes = count

    def finish(self) -> None:
        """Count one mesh out, which has its answer."""
        self._admission.answer()
        self._meshes -= 1

    def take_back(self) -> bool:
        """Drop the work that has not begun. Returns whether there was any."""
        dropped = [job.cancel() for job in self.jobs]
        return any(dropped)

    def end(self) -> None:
        """Give back what the request held, and take back what it no longer waits for."""
        self.take_back()
        self._admission.release(self._notes.received)
        self._admission.leave(self._meshes)
        self._admission.depart()
