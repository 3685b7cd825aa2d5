"""One connection of a client, held no longer than a request may take to arrive."""

import asyncio

from uvicorn.protocols.http.httptools_impl import HttpToolsProtocol

# Request line and headers together, in bytes.
MOST_HEAD_BYTES = 64 * 1024


def bounded_connection(seconds: float) -> type[asyncio.Protocol]:
    """A connection that is closed when a request is not there after `seconds`, however it
    dawdles, and whether or not its answer was given before; or when its headers have no end."""

    class Connection(HttpToolsProtocol):
        _watch: asyncio.TimerHandle | None = None
        _head_bytes = 0

        def connection_made(self, transport: asyncio.Transport) -> None:  # type: ignore[override]
            super().connection_made(transport)
            self._arm()

        def connection_lost(self, exc: Exception | None) -> None:
            self._disarm()
            super().connection_lost(exc)

        def data_received(self, data: bytes) -> None:
            if self._head_bytes > MOST_HEAD_BYTES:
                self.send_400_response("The request's headers are too long.")
                return
            # Set back to 0 on the way, where this data ends a head.
            self._head_bytes += len(data)
            super().data_received(data)

        def on_message_begin(self) -> None:
            super().on_message_begin()
            self._arm()

        def on_headers_complete(self) -> None:
            super().on_headers_complete()
            self._head_bytes = 0

        def on_body(self, body: bytes) -> None:
            self._head_bytes = 0
            super().on_body(body)

        def on_message_complete(self) -> None:
            self._head_bytes = 0
            self._disarm()
            super().on_message_complete()

        def _arm(self) -> None:
            self._disarm()
            self._watch = self.loop.call_later(seconds, self.transport.close)

        def _disarm(self) -> None:
            if self._watch is not None:
                self._watch.cancel()
                self._watch = None

    return Connection
