"""A process that reads hostile files, in little memory and with nothing else to read."""

import resource
import sys
from contextlib import suppress
from multiprocessing.connection import Connection

from meshconv3d.model.errors import MeshError
from meshconv3d.model.loading import load_mesh, warm_up
from tests.hostile import HOSTILE

MEMORY = 400 * 2**20  # bytes that reading may take on top of what the process has
_FORBIDDEN = ("open", "socket.connect", "socket.getaddrinfo", "subprocess.Popen", "os.system")


def serve(connection: Connection) -> None:
    """Reads the file of each title that is sent; answers with the error, or the count of faces."""
    warm_up()
    files = {title: file.data for title, file in HOSTILE.items()}
    for title in (
        "obj: a line of spaces",
        "gltf: an empty object",
        "threemf: UTF-16",
        "threemf: latin-1",
    ):
        with suppress(MeshError):
            load_mesh(files[title], HOSTILE[title].name)  # imports what is imported late
    with open("/proc/self/statm") as statm:
        size = int(statm.read().split()[0]) * resource.getpagesize()
    resource.setrlimit(resource.RLIMIT_AS, (size + MEMORY, size + MEMORY))
    sys.addaudithook(_forbid)
    connection.send(len(files))
    while title := connection.recv():
        try:
            connection.send(len(load_mesh(files[title], HOSTILE[title].name).faces))
        except Exception as error:
            connection.send(error)


def _forbid(event: str, arguments: tuple) -> None:
    if event in _FORBIDDEN:
        raise SystemExit(f"{event} {arguments[0]}")  # which no reader takes for damage
