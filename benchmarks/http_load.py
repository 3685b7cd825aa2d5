"""A light HTTP client: many kept connections, raw sockets, one request over and over.

It runs in a process of its own (`drive`), and costs so little that it is not what is measured.
"""

import contextlib
import multiprocessing
import selectors
import socket
import time
from collections import Counter
from dataclasses import dataclass, field


@dataclass
class Tally:
    """Answers. statuses: answers by status, -1 for a connection that was closed; latencies:
    seconds of each answer with status 200; seconds: how long it all took."""

    seconds: float = 0.0
    statuses: Counter[int] = field(default_factory=Counter)
    latencies: list[float] = field(default_factory=list)

    def rate(self, status: int) -> float:
        """Answers of this status per second."""
        return self.statuses[status] / self.seconds


class _Connection:
    """One kept connection. started: when its request was sent, or None if it is free."""

    def __init__(self, port: int, selector: selectors.BaseSelector) -> None:
        self.started: float | None = None
        self._answer = b""
        self._unsent = memoryview(b"")
        self._selector = selector
        self._socket = socket.create_connection(("127.0.0.1", port))
        self._socket.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        self._socket.setblocking(False)
        selector.register(self._socket, selectors.EVENT_READ, self)

    def ask(self, request: bytes) -> None:
        self.started = time.perf_counter()
        self._unsent = memoryview(request)
        self._send()

    def ready(self, events: int) -> int | None:
        """Read on; returns the status of a complete answer, -1 if there will be none."""
        try:
            if events & selectors.EVENT_WRITE:
                self._send()
            if not events & selectors.EVENT_READ:
                return None
            piece = self._socket.recv(65536)
        except ConnectionError:
            piece = b""
        if not piece:
            self._selector.unregister(self._socket)
            self._socket.close()
            return -1
        self._answer += piece
        head, found, body = self._answer.partition(b"\r\n\r\n")
        if not found:
            return None
        length = int(head.lower().partition(b"content-length: ")[2].partition(b"\r\n")[0])
        if len(body) < length:
            return None
        self._answer = b""
        return int(head[9:12])

    def _send(self) -> None:
        with contextlib.suppress(BlockingIOError):
            self._unsent = self._unsent[self._socket.send(self._unsent) :]
        events = selectors.EVENT_READ | (selectors.EVENT_WRITE if self._unsent else 0)
        if events != self._selector.get_key(self._socket).events:
            self._selector.modify(self._socket, events, self)


def drive(
    port: int, request: bytes, connections: int, seconds: float, rate: float | None = None
) -> Tally:
    """Send `request` over and over from a process of its own, and count what comes back.

    rate: requests per second, as far as there are free connections to send them on; with None,
        each connection sends its next request as soon as it has its answer.
    """
    context = multiprocessing.get_context("spawn")
    reader, writer = context.Pipe(duplex=False)
    arguments = (writer, port, request, connections, seconds, rate)
    process = context.Process(target=_drive, args=arguments)
    process.start()
    tally = reader.recv()
    process.join()
    return tally


def _drive(writer, port, request, connections, seconds, rate) -> None:
    selector = selectors.DefaultSelector()
    free = [_Connection(port, selector) for _ in range(connections)]
    tally = Tally()
    started = time.perf_counter()
    sent = 0
    while (now := time.perf_counter() - started) < seconds:
        due = len(free) if rate is None else min(len(free), int(rate * now) - sent)
        for _ in range(due):
            free.pop().ask(request)
        # Requests for which no connection was free are not made up for later.
        sent = sent + due if rate is None or free else int(rate * now)
        # With a rate, the next request may be due before the next answer comes.
        for key, events in selector.select(timeout=0.1 if rate is None else 0.001):
            connection: _Connection = key.data
            status = connection.ready(events)
            if status is None:
                continue
            if connection.started is None:
                free.remove(connection)  # closed by the service while nothing was asked
            else:
                tally.statuses[status] += 1
                if status == 200:
                    tally.latencies.append(time.perf_counter() - connection.started)
                connection.started = None
            free.append(connection if status > 0 else _Connection(port, selector))
    tally.seconds = time.perf_counter() - started
    writer.send(tally)
