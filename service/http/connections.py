"""One connection of a client: how long it is held, and what of it is not taken.

A refusal is the app's to give: it finds the reason in `scope["state"]["refusal"]`.
"""

import asyncio
import math
from typing import Any

import httptools
from uvicorn._types import ASGI3Application
from uvicorn.protocols.http.httptools_impl import HttpToolsProtocol, RequestResponseCycle

from meshconv3d.service.http.errors import BadBody, BadHead, HeadTooLong, UpgradeAsked
from meshconv3d.service.http.refusing import Refusal, crowded

# Request line and headers together, in bytes.
MOST_HEAD_BYTES = 64 * 1024
# How many connections above the limit are open, to be told so. Those beyond are closed untold.
CROWD = 128
# In place of one that cannot be read: the app is asked it, and gives the refusal.
_REQUEST = b"GET /none HTTP/1.0\r\n\r\n"


def bounded_connection(seconds: float, most: int) -> type[asyncio.Protocol]:
    """A connection, of which `most` are served at a time.

    It is closed when a request is not there after `seconds`, however it dawdles, and whether or
    not its answer was given before; and when an answer waits for so long to be taken further.
    """

    class Connection(HttpToolsProtocol):
        _watch: asyncio.TimerHandle | None = None
        _reading: asyncio.TimerHandle | None = None
        _head_bytes = 0
        _in_body = False
        _refusal: Refusal | None = None
        _answered: RequestResponseCycle | None = None

        def connection_made(self, transport: asyncio.Transport) -> None:  # type: ignore[override]
            super().connection_made(transport)
            if len(self.connections) > most + CROWD:
                transport.abort()
            self._arm()

        def connection_lost(self, exc: Exception | None) -> None:
            self._disarm()
            self._stop_awaiting()
            super().connection_lost(exc)
            # Uvicorn tells the latest request. Where several came at once, another is answered.
            if self._answered is not None:
                self._answered.disconnected = True
                self._answered.message_event.set()

        def data_received(self, data: bytes) -> None:
            if self._refusal is not None:
                return
            # Set back to 0 on the way, where this data ends a head.
            self._head_bytes += len(data)
            super().data_received(data)
            if self._head_bytes > MOST_HEAD_BYTES and self._refusal is None:
                self._refuse(HeadTooLong(MOST_HEAD_BYTES))

        def send_400_response(self, msg: str) -> None:
            self._refuse(BadBody() if self._in_body else BadHead())

        def on_message_begin(self) -> None:
            super().on_message_begin()
            self._arm()

        def on_headers_complete(self) -> None:
            refusal = self._refusal
            if refusal is None and len(self.connections) > most:
                refusal = crowded(most)
            if refusal is None and self._head_size() > MOST_HEAD_BYTES:
                refusal = HeadTooLong(MOST_HEAD_BYTES)
            if refusal is None and self.parser.should_upgrade() and self._has_body():
                refusal = UpgradeAsked()
            self._told()["refusal"] = refusal
            super().on_headers_complete()
            self._head_bytes = 0
            self._in_body = True
            if refusal is not None:
                self.cycle.keep_alive = False

        def on_body(self, body: bytes) -> None:
            self._head_bytes = 0
            super().on_body(body)

        def on_message_complete(self) -> None:
            self._head_bytes = 0
            self._in_body = False
            self._disarm()
            super().on_message_complete()

        def _start_asgi_task(self, cycle: RequestResponseCycle, app: ASGI3Application) -> None:
            self._answered = cycle
            super()._start_asgi_task(cycle, app)

        def on_response_complete(self) -> None:
            super().on_response_complete()
            if self.transport.is_closing():
                self._await_reader()

        def timeout_keep_alive_handler(self) -> None:
            super().timeout_keep_alive_handler()
            self._await_reader()

        def pause_writing(self) -> None:
            super().pause_writing()
            self._await_reader()

        def resume_writing(self) -> None:
            super().resume_writing()
            if not self.transport.is_closing():
                self._stop_awaiting()

        def _refuse(self, refusal: Refusal) -> None:
            """Take no more of this connection. What came before is answered, and then this."""
            self._refusal = refusal
            if not self._in_body:
                self.parser = httptools.HttpRequestParser(self)
                self.parser.feed_data(_REQUEST)
                self.scope["method"] = "none"
            elif self.cycle.response_complete:
                self.transport.close()
            else:
                self._told()["refusal"] = refusal
                self.cycle.keep_alive = False
                self.cycle.message_event.set()

        def _head_size(self) -> int:
            """Bytes of the request's target and headers, which may all have come at once."""
            return len(self.url) + sum(len(name) + len(value) + 4 for name, value in self.headers)

        def _has_body(self) -> bool:
            return any(
                name in (b"content-length", b"transfer-encoding") for name, _ in self.headers
            )

        def _told(self) -> dict[str, Any]:
            """What the app is told of the request, beside what is in it."""
            return self.scope["state"]  # type: ignore[typeddict-item]

        def _arm(self) -> None:
            self._disarm()
            self._watch = self.loop.call_later(seconds, self.transport.abort)

        def _disarm(self) -> None:
            if self._watch is not None:
                self._watch.cancel()
                self._watch = None

        def _await_reader(self, before: float = math.inf) -> None:
            """Give the connection up once nothing of the answer that waits is taken in a while."""
            self._stop_awaiting()
            waiting = self.transport.get_write_buffer_size()
            if waiting >= before:
                self.transport.abort()
            elif waiting:
                self._reading = self.loop.call_later(seconds, self._await_reader, waiting)

        def _stop_awaiting(self) -> None:
            if self._reading is not None:
                self._reading.cancel()
                self._reading = None

    return Connection
