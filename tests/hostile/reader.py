"""A process that reads hostile files, within bounds that an honest reader keeps."""

import resource
from multiprocessing.connection import Connection

from model.loading import load_mesh
from tests.hostile import HOSTILE

MEMORY = 400 * 2**20  # bytes that reading may take on top of what the process has


def serve(connection: Connection) -> None:
    """Reads the file of each title that is sent; answers with the error, or the count of faces."""
    files = {title: file.data for title, file in HOSTILE.items()}
    with open("/proc/self/statm") as statm:
        size = int(statm.read().split()[0]) * resource.getpagesize()
    resource.setrlimit(resource.RLIMIT_AS, (size + MEMORY, size + MEMORY))
    connection.send(len(files))
    while title := connection.recv():
        try:
            connection.send(len(load_mesh(files[title], HOSTILE[title].name).faces))
        except Exception as error:
            connection.send(error)
