"""One worker process, behind calls that wait for it."""

import ctypes
import multiprocessing
import os
import select
import signal
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from multiprocessing import resource_tracker
from multiprocessing.context import ForkServerContext
from typing import Any

from model.errors import UnusableMesh
from service.workers.process import WARM_UP, run
from service.workers.tasks import Record, Setup, Work

# Compiling the kernels, where no compiled ones are at hand, takes ten seconds.
WARM_UP_SECONDS = 300.0
# A pipe takes three times this much: what was taken back and is still in it, what is to be done,
# and what is to be done next. To hand over more can take as long as the worker likes.
HANDED_AT_ONCE = 64 * 1024
# How long the system may take to tell how a process ended.
EXIT_SECONDS = 1.0


class DeadlineExceeded(Exception):
    """The time allowed for a piece of work is over."""


class NotStarted(Exception):
    """The worker was gone before it began with the work, or was asked not to: another may do it."""


class Worker:
    """A process that has warmed up; it ends when a file crashes it or overruns its deadline.

    Libraries of process pools hand work on through threads and locks of their own, which costs as
    much as the rest of a request, and share pipes that one killed worker breaks for all. Here each
    worker has a pipe to the one thread that waits for it.

    models: what each model says of itself. ended: whether it was seen to be dead, or ended;
    `alive`: whether it can be given work, which costs more to know.
    """

    def __init__(self, setup: Setup) -> None:
        """Start the process and wait until it is warm.

        Raises ModelFileError or SelfTestError for a model that cannot serve, NotStarted where the
        process does not live to tell.
        """
        context = _context()
        self.ended = False
        self._pipe, theirs = context.Pipe()
        # The calls of a connection that wait for it make a new one of these each time.
        self._answers = select.poll()
        self._answers.register(self._pipe, select.POLLIN)
        self._sent = 0
        self._overran = False
        self._begun = context.RawValue(ctypes.c_uint64)
        self._taken_back = context.RawValue(ctypes.c_uint64)
        arguments = (theirs, self._begun, self._taken_back, setup)
        self._process = context.Process(target=run, args=arguments, daemon=True)
        try:
            with _signals_held():
                self._process.start()
        except OSError as error:  # it was gone before it had read what it is to do
            raise _not_started(error) from None
        theirs.close()
        try:
            self.models: list[dict[str, Any]] = self._answer(WARM_UP, WARM_UP_SECONDS)
        except (EOFError, OSError) as error:  # of which TimeoutError is one
            self.end()
            raise _not_started(error) from None
        except BaseException:
            self.end()
            raise

    @property
    def alive(self) -> bool:
        return not self.ended and self._process.is_alive()

    def hand_over(self, work: Work, expires: float) -> int:
        """Give it work, after what it has; the number to ask for the answer under.

        A process that does not take it by `expires`, on the monotonic clock, is killed. One that is
        dead is found out when it is asked.
        """
        self._sent += 1
        with suppress(OSError):
            if work.size <= HANDED_AT_ONCE:
                self._pipe.send(work)
            else:
                self._hand_over_in_time(work, expires)
        return self._sent

    def _hand_over_in_time(self, work: Work, expires: float) -> None:
        watch = threading.Timer(expires - time.monotonic(), self._overrun)
        watch.start()
        try:
            self._pipe.send(work)
        finally:
            watch.cancel()

    def _overrun(self) -> None:
        self._overran = True
        self.kill()

    def take_back(self, number: int) -> bool:
        """Ask for this work not to be done. Returns False if it is too late for that: it has begun.

        Its answer need not be asked for then; nor after True.
        """
        self._taken_back.value = number
        return self._begun.value < number

    def answer(self, number: int, until: float) -> Record:
        """The answer to this work; those before it that were not asked for are dropped.

        Raises the error that it is: MeshError, of which a crash is one, or TaskFailed;
        TimeoutError where there is none by `until`, on the monotonic clock; DeadlineExceeded,
        NotStarted.
        """
        try:
            return self._answer(number, until - time.monotonic())
        except TimeoutError:
            raise
        except (EOFError, OSError):
            self.end()
            if self._overran:
                raise DeadlineExceeded from None
            if self._begun.value < number:
                raise NotStarted from None
            raise crashed(self._how_it_ended()) from None

    def _answer(self, wanted: int, seconds: float) -> Any:
        """The answer of a number. Raises the error that it is, TimeoutError, EOFError, OSError."""
        if self.ended:  # the system may have given the number of its pipe to another by now
            raise EOFError
        ends = time.monotonic() + seconds
        while self._answers.poll(max(ends - time.monotonic(), 0.0) * 1000):
            number, error, value = self._pipe.recv()
            if number != wanted:
                continue
            if error is not None:
                raise error
            if value is None:
                raise NotStarted
            return value
        raise TimeoutError

    def _how_it_ended(self) -> str:
        self._process.join(EXIT_SECONDS)
        code = self._process.exitcode
        return f"signal {-code}" if code is not None and code < 0 else f"exit code {code}"

    def kill(self) -> None:
        """Kill the process, whatever it does. From any thread: whoever waits for it is told."""
        self._process.kill()

    def end(self) -> None:
        """Kill the process, and give its pipe back."""
        if not self.ended:
            self.ended = True
            self.kill()
            self._pipe.close()


def _context() -> ForkServerContext:
    """Processes forked from a clean one, which has loaded the libraries and serves nothing."""
    # Read as the libraries are loaded. The processes are as many as the cores: no more threads.
    for library in ("OMP", "OPENBLAS", "MKL"):
        os.environ.setdefault(f"{library}_NUM_THREADS", "1")
    context = multiprocessing.get_context("forkserver")
    context.set_forkserver_preload(["service.workers.origin"])
    return context


@contextmanager
def _signals_held() -> Iterator[None]:
    """Within it, processes start whom no signal that asks to stop interrupts, as `origin` wants it,
    but from their first moment."""
    resource_tracker.ensure_running()  # which lets them through again as it starts
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT, signal.SIGTERM})
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


def _not_started(error: Exception) -> NotStarted:
    reason = str(error) or type(error).__name__
    return NotStarted(f"a worker process does not start: {reason}")


def crashed(how: str) -> UnusableMesh:
    """What is wrong with a file that its worker did not survive."""
    return UnusableMesh(
        "worker-crashed",
        f"this file made its reader crash ({how}); export the mesh again, in another format",
    )
