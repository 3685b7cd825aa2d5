"""One worker process, behind calls that wait for it."""

import multiprocessing
import os
import threading
import time
from concurrent.futures.process import BrokenProcessPool
from multiprocessing.context import ForkServerContext
from typing import Any

import pebble

from model.errors import UnusableMesh
from service.workers.tasks import Record, Setup, Work, classify, warm_up

# Compiling the kernels, where no compiled ones are at hand, takes ten seconds.
WARM_UP_SECONDS = 300.0

# A worker has nothing to clean up, and one that hangs in compiled code would not hear a request.
pebble.CONSTS.term_timeout = 0.0


class DeadlineExceeded(Exception):
    """The time allowed for a piece of work is over."""


class NotStarted(Exception):
    """The worker was gone before it began with the work, which another may do."""


class Worker:
    """A process that has warmed up; it ends when a file crashes it or overruns its deadline.

    It is a pool of one: the workers of one pebble pool share a pipe and its locks, and one that is
    killed while it holds them takes the others with it.

    models: what each model says of itself. `alive`: whether it can be given work.
    """

    def __init__(self, setup: Setup) -> None:
        """Start the process and wait until it is warm.

        Raises ModelFileError or SelfTestError for a model that cannot serve, NotStarted where the
        process does not live to tell.
        """
        self._ended = False
        self._pool = pebble.ProcessPool(max_workers=1, context=_context())
        warming = self._pool.schedule(warm_up, args=(setup,))
        try:
            self.models: list[dict[str, Any]] = warming.result(WARM_UP_SECONDS)
        except (pebble.ProcessExpired, BrokenProcessPool, TimeoutError) as error:
            self.end()
            raise NotStarted(f"a worker process does not start: {error}") from None
        except BaseException:
            self.end()
            raise

    @property
    def alive(self) -> bool:
        return not self._ended and self._pool.active

    def classify(self, work: Work, expires: float) -> Record:
        """Classify one mesh, by `expires` on the monotonic clock.

        Raises MeshError, of which a crash is one; DeadlineExceeded; NotStarted; TaskFailed.
        """
        left = expires - time.monotonic()
        if left <= 0:
            raise DeadlineExceeded
        try:
            running = self._pool.schedule(classify, args=(work,))
        except RuntimeError:
            raise NotStarted from None
        try:
            # Not pebble's own timeout, which begins once the worker says that it has begun.
            return running.result(left)
        except BrokenProcessPool:
            raise NotStarted from None
        except TimeoutError:
            self.end()
            raise DeadlineExceeded from None
        except pebble.ProcessExpired as expired:
            self.end()
            code = expired.exitcode
            how = f"signal {-code}" if code < 0 else f"exit code {code}"
            raise crashed(how) from None

    def end(self) -> None:
        """Kill the process, whatever it does."""
        if self._ended:
            return
        self._ended = True
        self._pool.stop()
        # Not waited for: after a kill in the middle of a message, the pipe may never end.
        threading.Thread(target=self._pool.join, daemon=True).start()


def _context() -> ForkServerContext:
    """Processes forked from a clean one, which has loaded the libraries and serves nothing."""
    # Read as the libraries are loaded. The processes are as many as the cores: no more threads.
    for library in ("OMP", "OPENBLAS", "MKL"):
        os.environ.setdefault(f"{library}_NUM_THREADS", "1")
    context = multiprocessing.get_context("forkserver")
    context.set_forkserver_preload(["service.workers.origin"])
    return context


def crashed(how: str) -> UnusableMesh:
    """What is wrong with a file that its worker did not survive."""
    return UnusableMesh(
        "worker-crashed",
        f"this file made its reader crash ({how}); export the mesh again, in another format",
    )
