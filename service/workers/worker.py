"""One worker process, behind calls that wait for it."""

import asyncio
import ctypes
import multiprocessing
import os
import signal
import socket
import threading
import time
from collections.abc import Iterator
from concurrent.futures import Future
from contextlib import contextmanager
from multiprocessing import resource_tracker
from multiprocessing.context import ForkServerContext

from meshconv3d.model.errors import UnusableMesh
from meshconv3d.service.models import ModelInfo
from meshconv3d.service.prediction import Prediction
from meshconv3d.service.workers.frames import LENGTH, framed, read_frame, value_of
from meshconv3d.service.workers.process import WARM_UP, run
from meshconv3d.service.workers.tasks import Setup, Task

# Compiling the kernels, where no compiled ones are at hand, takes ten seconds.
WARM_UP_SECONDS = 300.0
# How long the system may take to tell how a process ended.
EXIT_SECONDS = 1.0
# Of answers, which are records or meshes in colours, so much is read ahead of being asked for.
BUFFERED_BYTES = 1024 * 1024


class DeadlineExceeded(Exception):
    """The time allowed for a piece of work is over."""


class NotStarted(Exception):
    """The worker was gone before it began with the work, or was ended or asked not to by this side:
    another may do it."""


class Worker:
    """A process that has warmed up; it ends when a file crashes it or overruns its deadline.

    Libraries of process pools hand work on through threads and locks of their own, which costs as
    much as the rest of a request, and share pipes that one killed worker breaks for all. Here each
    worker has a socket to the event loop that waits for it.

    models: what each model says of itself. ended: whether it was seen to be dead, or ended;
    `alive`: whether it can be given work, which costs more to know.
    """

    def __init__(self, setup: Setup) -> None:
        """Start the process and wait until it is warm, which takes no event loop.

        Raises ModelFileError or SelfTestError for a model that cannot serve, NotStarted where the
        process does not live to tell.
        """
        context = _context()
        self.ended = False
        self._socket, theirs = socket.socketpair()
        self._reader: asyncio.StreamReader
        self._writer: asyncio.StreamWriter | None = None
        self._length: int | None = None  # of the answer whose first bytes have come
        self._sent = 0
        self._begun = context.RawValue(ctypes.c_uint64)
        self._taken_back = context.RawValue(ctypes.c_uint64)
        arguments = (theirs, self._begun, self._taken_back, setup)
        self._process = context.Process(target=run, args=arguments, daemon=True)
        try:
            with _signals_held():
                self._process.start()
        except OSError as error:  # it was gone before it had read what it is to do
            self._socket.close()
            raise _not_started(error) from None
        finally:
            theirs.close()
        try:
            self.models: list[ModelInfo] = self._warm_up()
        except (EOFError, OSError) as error:  # of which TimeoutError is one
            self.end()
            raise _not_started(error) from None
        except BaseException:
            self.end()
            raise

    def _warm_up(self) -> list[ModelInfo]:
        self._socket.settimeout(WARM_UP_SECONDS)
        with self._socket.makefile("rb") as stream:
            number, error, models = read_frame(stream)
        assert number == WARM_UP
        if error is not None:
            raise error
        return models

    async def attach(self) -> None:
        """Be handed work by the event loop that runs, and no other."""
        self._reader, self._writer = await asyncio.open_unix_connection(
            sock=self._socket, limit=BUFFERED_BYTES
        )

    @property
    def alive(self) -> bool:
        return not self.ended and self._process.is_alive()

    def hand_over(self, work: Task) -> int:
        """Give it work, after what it has; the number to ask for the answer under.

        A process that is dead is found out when it is asked.
        """
        assert self._writer is not None
        self._sent += 1
        if not self._writer.is_closing():
            self._writer.writelines(framed(work))
        return self._sent

    def take_back(self, number: int) -> bool:
        """Ask for this work not to be done. Returns False if it is too late for that: it has begun.

        Its answer need not be asked for then; nor after True.
        """
        self._taken_back.value = number
        return self._begun.value < number

    async def answer(self, number: int, until: float) -> Prediction:
        """The answer to this work; those before it that were not asked for are dropped.

        Raises the error that it is: MeshError, of which a crash is one, or TaskFailed;
        TimeoutError where there is none by `until`, on the monotonic clock; NotStarted.
        """
        try:
            async with asyncio.timeout(until - time.monotonic()):
                return await self._answer(number)
        except TimeoutError:
            raise
        except (EOFError, OSError):
            ended_here = self.ended
            self.end()
            if ended_here or self._begun.value < number:
                raise NotStarted from None
            raise crashed(await asyncio.to_thread(self._how_it_ended)) from None

    async def _answer(self, wanted: int) -> Prediction:
        """The answer of a number. Raises the error that it is, EOFError, OSError."""
        while True:
            number, error, value = await self._next_answer()
            if number != wanted:
                continue
            if error is not None:
                raise error
            if value is None:
                raise NotStarted
            return value

    async def _next_answer(self) -> tuple[int, Exception | None, Prediction | None]:
        """Whoever waits for it may give up between the two reads."""
        length = self._length
        if length is None:
            (length,) = LENGTH.unpack(await self._reader.readexactly(LENGTH.size))
            self._length = length
        content = await self._reader.readexactly(length)
        self._length = None
        return value_of(content)

    def _how_it_ended(self) -> str:
        self._process.join(EXIT_SECONDS)
        code = self._process.exitcode
        return f"signal {-code}" if code is not None and code < 0 else f"exit code {code}"

    def end(self) -> None:
        """Kill the process, whatever it does, and give its socket back.

        From the loop that it is attached to: whoever waits for an answer is told.
        """
        if not self.ended:
            self.ended = True
            self._process.kill()
            if self._writer is None:
                self._socket.close()
            else:
                self._writer.close()


def start_worker(setup: Setup) -> Future[Worker]:
    """A new worker, or what `Worker` raises.

    In a thread for which nobody has to wait where the service ends meanwhile.
    """
    started: Future[Worker] = Future()
    started.set_running_or_notify_cancel()

    def start() -> None:
        try:
            started.set_result(Worker(setup))
        except Exception as error:
            started.set_exception(error)

    threading.Thread(target=start, daemon=True, name="worker-start").start()
    return started


def _context() -> ForkServerContext:
    """Processes forked from a clean one, which has loaded the libraries and serves nothing."""
    # Read as the libraries are loaded. The processes are as many as the cores: no more threads.
    for library in ("OMP", "OPENBLAS", "MKL"):
        os.environ.setdefault(f"{library}_NUM_THREADS", "1")
    context = multiprocessing.get_context("forkserver")
    context.set_forkserver_preload(["meshconv3d.service.workers.origin"])
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
