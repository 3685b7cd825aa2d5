"""A folder of meshes, good and bad, and a service that runs."""

import re
import signal
import subprocess
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

import httpx
import pytest

from meshconv3d.model.mesh import Mesh
from tests.commands import PROGRAM, environment
from tests.meshes import cube, sheet, torus

LIMIT = 400_000


def obj(mesh: Mesh) -> bytes:
    """A mesh as an OBJ file."""
    vertices = [f"v {x!r} {y!r} {z!r}" for x, y, z in mesh.vertices.tolist()]
    faces = [f"f {a} {b} {c}" for a, b, c in (mesh.faces + 1).tolist()]
    return "\n".join([*vertices, *faces, ""]).encode()


@pytest.fixture(scope="session")
def meshes(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with three good files, one of them in a folder below, and two bad ones."""
    folder = tmp_path_factory.mktemp("meshes")
    (folder / "below").mkdir()
    (folder / "below" / "cube.OBJ").write_bytes(obj(cube()))
    (folder / "ring.obj").write_bytes(obj(torus()))
    (folder / "sheet.obj").write_bytes(obj(sheet()))
    (folder / "points.obj").write_text("v 0 0 0\nv 1 0 0\n")
    (folder / "cut.stl").write_bytes(b"\0" * 10)
    (folder / "notes.txt").write_text("no mesh")
    return folder


@dataclass(frozen=True)
class Service:
    """A running `meshconv3d serve`."""

    url: str
    process: subprocess.Popen[bytes]
    log: Path

    def stop(self, how: signal.Signals = signal.SIGTERM) -> int:
        self.process.send_signal(how)
        return self.process.wait(30)


Start = Callable[..., Service]


@contextmanager
def services(model_file: Path, logs: pytest.TempPathFactory) -> Iterator[Start]:
    """Starts services, each ready when it is returned, and ends what is left of them.

    Each has the small model first; `alone`, only those that its options name.
    """
    processes = []

    def start(*options: str, alone: bool = False, **variables: str) -> Service:
        log = logs.mktemp("service") / "log"
        models = () if alone else ("--model", str(model_file))
        command = [PROGRAM, "serve", *models, "--port", "0", *options]
        with log.open("wb") as stream:
            process = subprocess.Popen(
                command, stdout=stream, stderr=stream, env=environment(**variables)
            )
        processes.append(process)
        deadline = time.monotonic() + 60
        while time.monotonic() < deadline and process.poll() is None:
            running = re.search(r"running on (http://127\.0\.0\.1:\d+)", log.read_text())
            if running and httpx.get(f"{running[1]}/readyz").status_code == 200:
                return Service(running[1], process, log)
            time.sleep(0.05)
        raise AssertionError(f"the service does not start:\n{log.read_text()}")

    try:
        yield start
    finally:
        for process in processes:
            if process.poll() is None:
                process.kill()
                process.wait()


@pytest.fixture(scope="module")
def start(model_file: Path, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Start]:
    """`services` for a module's tests."""
    with services(model_file, tmp_path_factory) as start:
        yield start


@pytest.fixture(scope="session")
def service(model_file: Path, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Service]:
    """One for all tests that leave it as it is; it takes bodies of up to LIMIT bytes."""
    with services(model_file, tmp_path_factory) as start:
        yield start("--max-upload-bytes", str(LIMIT))


@pytest.fixture
def client(service: Service) -> Iterator[httpx.Client]:
    with httpx.Client(base_url=service.url, timeout=60) as client:
        yield client
