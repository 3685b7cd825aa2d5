"""The server: the app under uvicorn, which stops without losing what it accepted."""

import errno
import gc
import logging
import math
import resource
import socket
import time
from types import FrameType

import uvicorn

from meshconv3d.service.classifier import slow_start_told
from meshconv3d.service.http.admission import Admission
from meshconv3d.service.http.app import create_app
from meshconv3d.service.http.connections import CROWD, bounded_connection
from meshconv3d.service.models import ModelFile
from meshconv3d.service.settings import Settings
from meshconv3d.service.workers import Setup, WorkerPool

log = logging.getLogger(__name__)

# The app answers at the deadline; the connection is closed only where that did not end it.
CONNECTION_MARGIN = 2.0
# Longer than proxies keep an idle connection: the side that closes it first may lose a request.
KEEP_ALIVE_SECONDS = 75
# New objects between two runs of the youngest garbage collection; a request makes some thousand.
# Python's 700 cost a sixth of the front's time with hundreds of requests waiting.
GARBAGE_THRESHOLD = 20_000
# Connections that wait to be accepted, before the system refuses more.
BACKLOG = 2048

# Headers of every answer, against browsers that guess types. Strict-Transport-Security is up to the
# proxy that ends TLS in front of the service.
SECURITY_HEADERS = [("x-content-type-options", "nosniff"), ("referrer-policy", "no-referrer")]

# Open files: a connection and the file of the page that is sent over it; pipes of a worker, and to
# its replacement; those of the libraries, the log and the event loop.
FILES_PER_CONNECTION = 2
FILES_PER_WORKER = 8
OTHER_FILES = 64

# Why an address cannot be had, and what to do.
REASONS = {
    errno.EADDRINUSE: "the port is taken; choose another with --port, or 0 for a free one",
    errno.EACCES: "the port is not for everyone, as those below 1024 are not; choose another with "
    "--port, such as 8000",
    errno.EADDRNOTAVAIL: "that is no address of this machine; --host takes one of its own, or "
    "0.0.0.0 for all",
}


class CannotListen(Exception):
    """An address at which the service cannot listen. The message says why, and what to do."""


class TooFewFiles(Exception):
    """The system allows fewer open files than the settings need. The message says what to do."""


def start_workers(settings: Settings) -> WorkerPool:
    """Start all workers and wait until they are warm.

    Raises ModelFileError, SelfTestError or NotStarted.
    """
    files = [ModelFile.read(name) for name in settings.models]
    setup = Setup(files, settings.limits, settings.worker_memory_bytes, settings.deadline_seconds)
    pool = WorkerPool(setup, settings.workers)
    log.info("starting %d workers", settings.workers)
    with slow_start_told(log.info):
        pool.start()
    return pool


def run(settings: Settings, pool: WorkerPool, sockets: list[socket.socket]) -> None:
    """Serve until a signal says to stop, and all that was accepted is answered.

    sockets: those of `bind`. Raises LibraryError.
    """
    library = None
    if settings.library is not None:
        from meshconv3d.service.library import Library  # its extra may be missing

        library = Library.read(settings.library, [info.card for info in pool.models.values()])
    admission = Admission(
        settings.max_queue_requests,
        settings.max_queue_bytes,
        settings.deadline_seconds,
        settings.workers,
    )
    config = uvicorn.Config(
        create_app(pool, admission, settings, library),
        http=bounded_connection(answer_seconds(settings), settings.max_connections, admission),
        ws="none",
        lifespan="on",
        timeout_keep_alive=KEEP_ALIVE_SECONDS,
        server_header=False,
        headers=SECURITY_HEADERS,
        log_config=None,
        backlog=BACKLOG,
        access_log=False,  # the telemetry middleware logs more of each request
    )
    log.info(
        "serving %s with %d workers",
        *(", ".join(pool.models), settings.workers),
        extra={"models": {name: info.sha256 for name, info in pool.models.items()}},
    )
    gc.freeze()  # what is there by now stays, and need not be searched again and again
    gc.set_threshold(GARBAGE_THRESHOLD)
    _Server(config, admission, settings.grace_seconds).run(sockets)
    log.info("stopped")


class _Server(uvicorn.Server):
    """Told to stop, it goes on listening, says that it is not ready, and takes no new work; it
    ends when all work is done, when `grace` seconds are over, or at a second signal."""

    def __init__(self, config: uvicorn.Config, admission: Admission, grace: float) -> None:
        super().__init__(config)
        self._admission = admission
        self._grace = grace
        self._ends = math.inf

    async def startup(self, sockets: list[socket.socket] | None = None) -> None:
        await super().startup(sockets)
        addresses = ", ".join(_address(each) for each in sockets or ())
        log.info("running on %s: a browser shows the page there, and the API at /docs", addresses)

    def handle_exit(self, sig: int, frame: FrameType | None) -> None:
        if self._admission.open:
            self._admission.close()
            self._ends = time.monotonic() + self._grace
        else:
            self.force_exit = self.should_exit  # it only waits for connections to close by now
            self._end(0)

    async def on_tick(self, counter: int) -> bool:
        left = self._ends - time.monotonic()
        if not self._admission.open and (self._admission.idle or left <= 0):
            self._end(max(0, math.ceil(left)))
        return await super().on_tick(counter)

    def _end(self, seconds: int) -> None:
        """Stop listening, and end after so many seconds at the latest."""
        self.should_exit = True
        self.config.timeout_graceful_shutdown = seconds


def answer_seconds(settings: Settings) -> float:
    """After so many seconds, a connection is closed on which an answer has not ended."""
    return settings.deadline_seconds + CONNECTION_MARGIN


def bind(settings: Settings) -> list[socket.socket]:
    """A socket for each address at which to serve; nothing connects before the server listens.

    A connection is dropped where its client takes nothing of an answer for the `answer_seconds`
    (on Linux). Raises CannotListen.
    """
    sockets = []
    for port in (settings.port, settings.metrics_port):
        if port is not None:
            sockets += _bind(settings.host, port)
    for each in sockets if hasattr(socket, "TCP_USER_TIMEOUT") else ():
        milliseconds = int(answer_seconds(settings) * 1000)
        each.setsockopt(socket.IPPROTO_TCP, socket.TCP_USER_TIMEOUT, milliseconds)
    return sockets


def _bind(host: str, port: int) -> list[socket.socket]:
    """A socket for each address of a host; port 0 is a free one. Raises CannotListen."""
    try:
        found = socket.getaddrinfo(host, port, type=socket.SOCK_STREAM, flags=socket.AI_PASSIVE)
        sockets = []
        for family, kind, protocol, _, address in found:
            sockets.append(socket.socket(family, kind, protocol))
            sockets[-1].setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
            if family == socket.AF_INET6:
                sockets[-1].setsockopt(socket.IPPROTO_IPV6, socket.IPV6_V6ONLY, 1)
            sockets[-1].bind(address)
    except socket.gaierror:
        reason = "that is no host; --host takes an address of this machine, or 0.0.0.0 for all"
    except OSError as error:
        reason = REASONS.get(error.errno or 0, str(error))
    else:
        return sockets
    raise CannotListen(f"cannot listen at {host}, port {port}: {reason}")


def _address(listening: socket.socket) -> str:
    """The address of a socket as a browser takes it."""
    host, port = listening.getsockname()[:2]
    return f"http://[{host}]:{port}" if ":" in host else f"http://{host}:{port}"


def raise_file_limit(settings: Settings) -> None:
    """Raise this process's limit of open files to what the settings need, if it is lower.

    With too few, connections wait unseen and workers are not replaced. Raises TooFewFiles where
    the system does not allow it.
    """
    beside = OTHER_FILES + FILES_PER_WORKER * settings.workers + CROWD
    needed = beside + FILES_PER_CONNECTION * settings.max_connections
    soft, hard = resource.getrlimit(resource.RLIMIT_NOFILE)
    if soft == resource.RLIM_INFINITY or soft >= needed:
        return
    if hard != resource.RLIM_INFINITY and hard < needed:
        possible = (hard - beside) // FILES_PER_CONNECTION
        lower = f", or lower --max-connections to {possible}" if possible > 1 else ""
        raise TooFewFiles(
            f"{settings.max_connections} connections and {settings.workers} workers need {needed} "
            f"open files, and the system allows {hard}; raise its limit (ulimit -Hn){lower}"
        )
    resource.setrlimit(resource.RLIMIT_NOFILE, (needed, hard))
