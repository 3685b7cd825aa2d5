"""One worker process and the socket to it. Calls block; one thread uses each worker."""

import multiprocessing
import os
import pickle
import signal
import socket
import time
from collections.abc import Sequence
from multiprocessing import resource_tracker
from multiprocessing.context import ForkServerContext
from typing import Any

from meshconv3d.model.errors import UnusableMesh
from meshconv3d.service.container import oom_kills
from meshconv3d.service.models import ModelInfo
from meshconv3d.service.prediction import Prediction
from meshconv3d.service.workers.tasks import Setup, Task, work

# Compiling the kernels, where no compiled ones are cached, takes a minute or two.
WARM_UP_SECONDS = 300.0
# Time the system may take to tell how a process ended.
EXIT_SECONDS = 1.0
# Signals of a terminal or a service manager, see `preload`.
STOP_SIGNALS = {signal.SIGINT, signal.SIGTERM}


class DeadlineExceeded(Exception):
    """The time for a task is over."""


class NotStarted(Exception):
    """A worker process ended before it was warm."""


class Worker:
    """A process that classifies one mesh at a time. ended: whether it was killed, or ended at a
    task."""

    def __init__(self, setup: Setup) -> None:
        """Start the process. Raises NotStarted."""
        context = _context()
        self.ended = False
        self._oom_kills = oom_kills()
        self._socket, theirs = socket.socketpair()
        # pickle writes a large content to a file as it is; a copy of it would hold the interpreter,
        # and with it the event loop.
        self._tasks, self._answers = self._socket.makefile("wb"), self._socket.makefile("rb")
        self._process = context.Process(target=work, args=(theirs, setup), daemon=True)
        # The fork server, which starts with the first worker, inherits this mask: no signal ends
        # it before `preload` ignores them. The resource tracker would unblock them as it starts.
        resource_tracker.ensure_running()
        signal.pthread_sigmask(signal.SIG_BLOCK, STOP_SIGNALS)
        try:
            self._process.start()
        except OSError as error:  # also EPIPE, where the process ended before it had its setup
            raise _not_started(error) from None
        finally:
            theirs.close()

    def warm_up(self) -> Sequence[ModelInfo]:
        """The models that it serves, once it is warm.

        Raises ModelFileError or SelfTestError for a model that cannot serve, NotStarted.
        """
        try:
            answer = self._receive(time.monotonic() + WARM_UP_SECONDS)
        except (EOFError, OSError) as error:
            answer = _not_started(error)
        if isinstance(answer, Exception):
            self.kill()
            raise answer
        return answer

    def lives(self) -> bool:
        """Whether the process lives; asks the system."""
        return not self.ended and self._process.is_alive()

    def classify(self, task: Task, until: float) -> Prediction | Exception | None:
        """Hand over a task and wait for the answer: a prediction, MeshError or TaskFailed.

        DeadlineExceeded if there is none by `until`, on the monotonic clock; the process is killed.
        A MeshError if the process ended at the task, and None if it ended before it had read it.
        Errors are returned: raised, they would keep the task by their tracebacks.
        """
        read = True
        try:
            try:
                self._socket.settimeout(_left(until))
                pickle.dump(task, self._tasks, pickle.HIGHEST_PROTOCOL)
                self._tasks.flush()
            except ConnectionError:
                read = False  # though it may have answered before it ended
            return self._receive(until)
        except TimeoutError:
            self.kill()
            return DeadlineExceeded()
        except ConnectionError:  # the system says so if the task, or part of it, was not read
            read = False
        except (EOFError, pickle.UnpicklingError):
            pass
        self.ended = True
        return self._crash() if read else None

    def _receive(self, until: float) -> Any:
        self._socket.settimeout(_left(until))
        return pickle.load(self._answers)

    def _crash(self) -> UnusableMesh:
        self._process.join(EXIT_SECONDS)
        code = self._process.exitcode
        if code is None or code >= 0:
            return crashed(f"exit code {code}")
        if -code != signal.SIGKILL:
            return crashed(f"signal {-code}")
        if oom_kills() > self._oom_kills:
            return UnusableMesh(
                "too-much-memory",
                "memory ran out as this file was read, and the system ended its reader; simplify "
                "the mesh or split it up, or give the service more memory or fewer workers",
            )
        return UnusableMesh(
            "worker-crashed",
            "the reader of this file was ended from outside (signal 9); send the file again",
        )

    def kill(self) -> None:
        """End the process at once, from any thread; the one that waits for its answer is told."""
        self.ended = True
        self._process.kill()


def crashed(how: str) -> UnusableMesh:
    """Error of a mesh at which a worker ended."""
    return UnusableMesh(
        "worker-crashed",
        f"this file made its reader crash ({how}); export the mesh again, in another format",
    )


def _context() -> ForkServerContext:
    """Processes forked from a server that has loaded the libraries and serves nothing."""
    # Read by the libraries as they load. There are as many processes as cores: one thread each.
    for library in ("OMP", "OPENBLAS", "MKL"):
        os.environ.setdefault(f"{library}_NUM_THREADS", "1")
    context = multiprocessing.get_context("forkserver")
    context.set_forkserver_preload(["meshconv3d.service.workers.preload"])
    return context


def _left(until: float) -> float:
    return max(until - time.monotonic(), 1e-3)  # 0 would be: do not wait


def _not_started(error: Exception) -> NotStarted:
    return NotStarted(f"a worker process does not start: {error or type(error).__name__}")
