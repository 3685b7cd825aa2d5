"""A service in a process of its own, with its default settings."""

import socket
import subprocess
import sys
import time
import urllib.error
import urllib.request
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass

MAIN = "from service.cli.main import main; main()"


@dataclass(frozen=True)
class Service:
    """Its address, and the seconds from its start until it was ready."""

    port: int
    process: int
    ready_after: float


@contextmanager
def service(model_name: str) -> Iterator[Service]:
    """A service that is ready. Raises RuntimeError where it ends instead."""
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        port = probe.getsockname()[1]
    command = [sys.executable, "-c", MAIN, "serve", "--model", model_name, "--port", str(port)]
    started = time.perf_counter()
    process = subprocess.Popen(command, stderr=subprocess.DEVNULL)
    try:
        while not _is_ready(port):
            if process.poll() is not None:
                raise RuntimeError(f"the service ended with {process.returncode}")
            time.sleep(0.02)
        yield Service(port, process.pid, time.perf_counter() - started)
    finally:
        process.terminate()
        process.wait()


def _is_ready(port: int) -> bool:
    try:
        with urllib.request.urlopen(f"http://127.0.0.1:{port}/readyz", timeout=5) as answer:
            return answer.status == 200
    except (urllib.error.URLError, ConnectionError):
        return False
