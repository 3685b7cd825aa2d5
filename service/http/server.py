"""The app under uvicorn, which ends without losing what it accepted."""

import gc
import logging
import math
import socket
import time
from types import FrameType

import uvicorn

from meshconv3d.service.http.admission import Admission
from meshconv3d.service.http.app import create_app
from meshconv3d.service.http.behind import open_admission
from meshconv3d.service.http.connections import bounded_connection
from meshconv3d.service.http.headers import SECURITY_HEADERS
from meshconv3d.service.http.listening import address, listen
from meshconv3d.service.settings import Settings
from meshconv3d.service.workers import WorkerPool

log = logging.getLogger(__name__)

# The app answers at the deadline; the connection is closed only where that did not end it.
CONNECTION_MARGIN = 2.0
# Longer than proxies keep an idle connection: whoever closes it first may lose the next request.
KEEP_ALIVE_SECONDS = 75
# New objects after which garbage is looked for among those that came last; a request makes some
# thousand. With hundreds of requests waiting, Python's 700 cost a sixth of the front's time.
GARBAGE_THRESHOLD = 20_000


def run(settings: Settings, pool: WorkerPool) -> None:
    """Serve until a signal says to stop, and all that was accepted is answered.

    Raises CannotListen.
    """
    sockets = listen(settings.host, settings.port)
    admission = open_admission(settings)
    config = uvicorn.Config(
        create_app(pool, admission, settings),
        http=bounded_connection(
            settings.deadline_seconds + CONNECTION_MARGIN, settings.max_connections
        ),
        ws="none",
        lifespan="on",
        timeout_keep_alive=KEEP_ALIVE_SECONDS,
        server_header=False,
        headers=SECURITY_HEADERS,
        log_config=None,
        access_log=False,  # `observing` says more of each request
    )
    log.info(
        "serving %s with %d workers",
        *(", ".join(pool.models), settings.workers),
        extra={"models": {name: info.sha256 for name, info in pool.models.items()}},
    )
    gc.freeze()  # what is there by now stays: it need not be gone through again and again
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
        log.info("running on %s", ", ".join(address(each) for each in sockets or ()))

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
