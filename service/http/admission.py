"""How much work is taken on: what is refused at once can be asked elsewhere, or later."""

import math
import time
from collections import deque
from collections.abc import Callable

# Answers over which the rate is measured.
RATE_WINDOW = 64


# A refusal is answered after so many seconds. To refuse takes time from those who were
# accepted, and who is refused at once asks again at once.
PAUSE_SECONDS = 2.0


class Full(Exception):
    """There is more to do than can be done in time. retry_after: seconds until that changes;
    pause: seconds until the client is told."""

    def __init__(self, reason: str, retry_after: int, pause: float = PAUSE_SECONDS) -> None:
        super().__init__(f"{reason}; try again in {retry_after} s, or at another instance")
        self.retry_after = retry_after
        self.pause = pause


class Admission:
    """Counts the requests that wait or run, each mesh of a batch for one, and the bytes that are
    held for them.

    patience: seconds that a request has; one that would wait longer is refused as it comes.
    workers: how many meshes are classified at a time. clock: seconds, monotonic.
    """

    def __init__(
        self,
        most_requests: int,
        most_bytes: int,
        patience: float,
        workers: int,
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        self._most_requests = most_requests
        self._most_bytes = most_bytes
        self._patience = patience
        self._workers = workers
        self._clock = clock
        # When answers were given, since a worker had last nothing to do: before that, they came as
        # they were asked for.
        self._answered: deque[float] = deque(maxlen=RATE_WINDOW)
        self._visitors = 0
        self.open = True
        self.requests = 0
        self.bytes = 0

    @property
    def idle(self) -> bool:
        """Whether no request is under way, not even its upload."""
        return self._visitors == 0

    def close(self) -> None:
        """Take no more requests; those that came before go on."""
        self.open = False

    def arrive(self) -> None:
        """Let a request begin its upload. Raises Full."""
        if not self.open:
            raise Full("the service is stopping", 1, pause=0.0)
        self._check()
        self._visitors += 1

    def depart(self) -> None:
        """A request that arrived has its answer."""
        self._visitors -= 1

    def enter(self, count: int = 1) -> None:
        """Count meshes in, whose upload is complete: all of them, or Full is raised."""
        self._check(count)
        self.requests += count

    def answer(self) -> None:
        """Count one mesh out, which was answered."""
        self._answered.append(self._clock())
        self.leave(1)

    def leave(self, count: int) -> None:
        """Count meshes out."""
        self.requests -= count
        if self.requests < self._workers:
            self._answered.clear()

    def hold(self, count: int) -> None:
        """Count bytes that came. Raises Full, and then they are not counted."""
        if self.bytes + count > self._most_bytes:
            reason = f"{self.bytes} bytes of uploads are held"
            raise Full(reason, self._retry_after(self.wait()))
        self.bytes += count

    def release(self, count: int) -> None:
        """Count bytes that are no longer held."""
        self.bytes -= count

    def wait(self) -> float:
        """Seconds that a request would wait, at the rate of the latest answers; 0 before any."""
        if not self._answered:
            return 0.0
        since = self._clock() - self._answered[0]
        return self.requests * since / len(self._answered)

    def _check(self, count: int = 1) -> None:
        """Raises Full where so many more would be too many."""
        wait = self.wait()
        if self.requests + count > self._most_requests:
            raise Full(f"{self.requests} requests are waiting", self._retry_after(wait))
        if wait > self._patience:
            raise Full(f"a request waits {wait:.0f} s", self._retry_after(wait - self._patience))

    def _retry_after(self, wait: float) -> int:
        return max(1, math.ceil(min(wait, self._patience)))
