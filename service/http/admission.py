"""Admission control: how many connections, requests and bytes are taken on.

`Admission` counts for the whole service, `Admitted` is the share of one request.
"""

import asyncio
import math
import time
from collections import deque
from collections.abc import Callable

from starlette.requests import Request
from starlette.types import ASGIApp, Receive, Scope, Send

from meshconv3d.service.http.access import OPEN_PATHS, Access
from meshconv3d.service.http.problems import Full, RequestError, answer_error
from meshconv3d.service.settings import Settings
from meshconv3d.service.workers import Job

# Answers over which the rate is measured.
RATE_WINDOW = 64
# Seconds for which the declared length of an upload is reserved; then, only what has come.
RESERVED_SECONDS = 2.0


class Admission:
    """Counts the meshes that wait or run, and the bytes that are held or expected for them.

    patience: seconds that a request has; one that would wait longer is refused as it comes.
    workers: meshes that are classified at a time. clock: seconds, monotonic.
    """

    def __init__(
        self,
        max_meshes: int,
        max_bytes: int,
        patience: float,
        workers: int,
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        self._max_meshes = max_meshes
        self._max_bytes = max_bytes
        self._patience = patience
        self._workers = workers
        self._clock = clock
        # Times of answers since a worker was last idle: before that, answers came as fast as
        # requests did.
        self._answered: deque[float] = deque(maxlen=RATE_WINDOW)
        self.open = True
        self.connections = 0
        self.requests = 0
        self.meshes = 0
        self.bytes = 0
        self.reserved_bytes = 0

    @property
    def idle(self) -> bool:
        """Whether no request is under way, not even an upload."""
        return self.requests == 0

    def close(self) -> None:
        """Take no more requests; those that came before go on."""
        self.open = False

    def arrive(self) -> None:
        """Count a request in that begins its upload. Raises Full."""
        if not self.open:
            raise Full("the service is stopping", 1, pause=0.0)
        self._check(1)
        self.requests += 1

    def depart(self) -> None:
        """Count a request out."""
        self.requests -= 1

    def enter(self, count: int = 1) -> None:
        """Count meshes in whose upload is complete. Raises Full, and then none is counted."""
        self._check(count)
        self.meshes += count

    def answer(self) -> None:
        """Count one mesh out that was answered."""
        self._answered.append(self._clock())
        self.leave(1)

    def leave(self, count: int) -> None:
        """Count meshes out."""
        self.meshes -= count
        if self.meshes < self._workers:
            self._answered.clear()

    def reserve(self, count: int) -> None:
        """Count bytes that will come. Raises Full, and then they are not counted."""
        if self.reserved_bytes + count > self._max_bytes:
            reason = f"{self.reserved_bytes} bytes of uploads are held or on their way"
            raise Full(reason, self._retry_after(self.wait()))
        self.reserved_bytes += count

    def wait(self) -> float:
        """Seconds that a request would wait, at the rate of the latest answers; 0 before any."""
        if not self._answered:
            return 0.0
        since = self._clock() - self._answered[0]
        return self.meshes * since / len(self._answered)

    def _check(self, count: int) -> None:
        """Raises Full where so many more meshes would be too many."""
        wait = self.wait()
        if self.meshes + count > self._max_meshes:
            raise Full(f"{self.meshes} requests are waiting", self._retry_after(wait))
        if wait > self._patience:
            raise Full(f"a request waits {wait:.0f} s", self._retry_after(wait - self._patience))

    def _retry_after(self, wait: float) -> int:
        return max(1, math.ceil(min(wait, self._patience)))


class Admitted:
    """The share of one request in what is counted. Where it finds no room, all of it is given back.

    expires: its deadline, on the monotonic clock. jobs: its meshes in the worker pool.
    """

    def __init__(self, admission: Admission, expires: float) -> None:
        self.expires = expires
        self.jobs: list[Job] = []
        self._admission = admission
        self._meshes = 0
        self._held = 0
        self._reserved = 0

    def reserve(self, total: int) -> None:
        """Reserve this many bytes in all. Raises Full."""
        if total > self._reserved:
            self._or_release(self._admission.reserve, total - self._reserved)
            self._reserved = total

    def give_back_rest(self) -> None:
        """Reserve no more than what has come."""
        self._admission.reserved_bytes -= self._reserved - self._held
        self._reserved = self._held

    def hold(self, count: int) -> None:
        """Count bytes that came. Raises Full."""
        self.reserve(self._held + count)
        self._held += count
        self._admission.bytes += count

    def enter(self, total: int) -> None:
        """Count in this many meshes in all. Raises Full."""
        if total > self._meshes:
            self._or_release(self._admission.enter, total - self._meshes)
            self._meshes = total

    def answer(self) -> None:
        """Count one mesh out that was answered."""
        self._admission.answer()
        self._meshes -= 1

    def cancel(self) -> bool:
        """Drop the meshes that have not begun. Returns whether there were any."""
        dropped = [job.cancel() for job in self.jobs]
        return any(dropped)

    def release(self) -> None:
        """Give back all bytes and meshes, and drop what has not begun."""
        self.cancel()
        self._admission.leave(self._meshes)
        self._admission.bytes -= self._held
        self._admission.reserved_bytes -= self._reserved
        self._meshes = self._held = self._reserved = 0

    def _or_release(self, count: Callable[[int], None], more: int) -> None:
        try:
            count(more)
        except Full:
            self.release()  # at once: the answer may come after a pause
            raise


def admitted(request: Request) -> Admitted:
    """The share of a POST request."""
    return request.state.admitted


class AdmissionMiddleware:
    """ASGI middleware: refuses requests that could not be read, are not allowed or find no room.

    An upload counts as work once it is complete, so that a slow one takes no place in the queue;
    its declared length is reserved as it begins, for a while.
    """

    def __init__(self, app: ASGIApp, admission: Admission, settings: Settings) -> None:
        self.app = app
        self._admission = admission
        self._settings = settings
        self._access = Access(settings)

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        if scope["type"] != "http":
            await self.app(scope, receive, send)
            return
        try:
            await self._admit(scope, receive, send)
        except RequestError as error:
            response = await answer_error(Request(scope), error)
            await response(scope, receive, send)

    async def _admit(self, scope: Scope, receive: Receive, send: Send) -> None:
        if (error := scope["state"].get("unreadable")) is not None:  # by `connections`
            raise error
        self._access.check(scope)
        connections = self._settings.max_connections
        if self._admission.connections > connections and scope["path"] not in OPEN_PATHS:
            raise Full(f"{connections} connections are open", 1, pause=0.0)
        if scope["method"] != "POST":
            await self.app(scope, receive, send)
            return
        self._admission.arrive()
        share = Admitted(self._admission, time.monotonic() + self._settings.deadline_seconds)
        scope["state"]["admitted"] = share
        timer = asyncio.get_running_loop().call_later(RESERVED_SECONDS, share.give_back_rest)
        try:
            share.reserve(min(declared_length(scope), self._settings.max_upload_bytes))
            await self.app(scope, receive, send)
        finally:
            timer.cancel()
            share.release()
            self._admission.depart()


def declared_length(scope: Scope) -> int:
    """The Content-Length of a request, or 0 without one."""
    value = dict(scope["headers"]).get(b"content-length", b"0")
    return int(value) if value.isdigit() and len(value) < 20 else 0
