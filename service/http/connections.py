"""Connections: bounds that uvicorn's settings do not have.

A connection is closed where a request is not there in time, and after an answer that other requests
did not wait for. A head that is too long and bytes that are no HTTP are refused: the reason is left
in `scope["state"]["unreadable"]`, so that the app answers, logs and counts it like every other.

uvicorn's h11 protocol bounds heads and requests by itself, but takes some 25 times as long as
httptools to read a body of 100 MB, on the event loop.
"""

import asyncio

import httptools
from uvicorn.protocols.http.httptools_impl import HttpToolsProtocol

from meshconv3d.service.http.admission import Admission
from meshconv3d.service.http.problems import RequestError

# Request line and headers together.
MAX_HEAD_BYTES = 16 * 1024
# Connections above the limit that are held open to be refused; those beyond are closed at once.
CROWD = 128

# Takes the place of a head that cannot be read, so that the app is asked and refuses it.
_SUBSTITUTE = b"GET /none HTTP/1.0\r\n\r\n"


def bounded_connection(
    seconds: float, max_connections: int, admission: Admission
) -> type[HttpToolsProtocol]:
    """uvicorn's protocol with bounds. seconds: until a whole request must be there."""

    class Connection(HttpToolsProtocol):
        _timer: asyncio.TimerHandle | None = None
        _head_bytes = 0  # of a head that is not complete yet
        _body: list[bytes]  # of the piece that is parsed
        _error: RequestError | None = None
        _ends = False  # nothing more is read of it

        def connection_made(self, transport: asyncio.Transport) -> None:  # type: ignore[override]
            super().connection_made(transport)
            self._body = []
            admission.connections = len(self.connections)
            if admission.connections > max_connections + CROWD:
                transport.abort()
            self._start_timer()

        def connection_lost(self, exc: Exception | None) -> None:
            self._stop_timer()
            super().connection_lost(exc)
            admission.connections = len(self.connections)

        def data_received(self, data: bytes) -> None:
            for start in range(0, len(data), MAX_HEAD_BYTES):
                if self._ends or self.transport.is_closing():
                    return
                piece = data[start : start + MAX_HEAD_BYTES]
                self._head_bytes += len(piece)
                super().data_received(piece)
                self._pass_body()
                if self._head_bytes > MAX_HEAD_BYTES:
                    self._refuse(_head_too_long())

        def on_message_begin(self) -> None:
            if self._is_answering():
                raise ValueError("pipelined")  # the client has to ask again
            super().on_message_begin()
            self._start_timer()

        def on_headers_complete(self) -> None:
            names = {name for name, _ in self.headers}
            length = len(self.url) + sum(len(name) + len(value) + 4 for name, value in self.headers)
            if length > MAX_HEAD_BYTES:
                self._error = _head_too_long()
            elif self.parser.should_upgrade() and names & {b"content-length", b"transfer-encoding"}:
                self._error = _upgrade_with_body()
            self.scope["state"]["unreadable"] = self._error  # type: ignore[typeddict-item]
            super().on_headers_complete()
            self._head_bytes = 0
            if self._error is not None or len(self.connections) > max_connections:
                self.cycle.keep_alive = False

        def on_body(self, body: bytes) -> None:
            self._head_bytes = 0
            self._body.append(body)

        def _pass_body(self) -> None:
            """Hand over a piece's chunks together: uvicorn copies all that waits at each one."""
            if self._body:
                super().on_body(b"".join(self._body))
                self._body.clear()

        def on_message_complete(self) -> None:
            self._head_bytes = 0
            self._pass_body()
            self._stop_timer()
            super().on_message_complete()

        def send_400_response(self, msg: str) -> None:
            self._refuse(_bad_http())

        def _is_answering(self) -> bool:
            return self.cycle is not None and not self.cycle.response_complete

        def _refuse(self, error: RequestError) -> None:
            """Read no more, and have the app answer an error, unless it is still at an answer."""
            self._ends = True
            if not self._is_answering():
                self._error = error
                self.parser = httptools.HttpRequestParser(self)
                self.parser.feed_data(_SUBSTITUTE)
            elif self.cycle.more_body:  # and will not come
                super().send_400_response(str(error))
            else:
                self.cycle.keep_alive = False

        def _start_timer(self) -> None:
            self._stop_timer()
            self._timer = self.loop.call_later(seconds, self.transport.abort)

        def _stop_timer(self) -> None:
            if self._timer is not None:
                self._timer.cancel()
                self._timer = None

    return Connection


def _bad_http() -> RequestError:
    detail = (
        "this is no HTTP/1.1 request; where it was meant for TLS, ask the proxy that ends it in "
        "front of this service"
    )
    return RequestError(400, "bad-http", detail)


def _head_too_long() -> RequestError:
    detail = (
        f"the request line and headers are longer than {MAX_HEAD_BYTES} bytes; send fewer headers, "
        "and the mesh as the body"
    )
    return RequestError(431, "head-too-long", detail, MAX_HEAD_BYTES)


def _upgrade_with_body() -> RequestError:
    # The parser takes what follows such a head for another protocol, and drops it.
    detail = (
        "a request with a body cannot change the protocol here; send it as HTTP/1.1, without the "
        "header Upgrade (curl --http1.1)"
    )
    return RequestError(400, "upgrade-with-body", detail)
