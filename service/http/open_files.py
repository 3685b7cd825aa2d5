"""How many files the system lets the service have open: each connection is one."""

import resource

from meshconv3d.service.http.connections import CROWD
from meshconv3d.service.settings import Settings

# A connection, and the file of the page that is sent over it.
FILES_OF_A_CONNECTION = 2
# Pipes to a worker, and to what forks one in its place.
FILES_OF_A_WORKER = 8
# The libraries', the log, the event loop's.
FILES_BESIDE = 64


class TooFewFiles(Exception):
    """The system allows fewer open files than the settings need. The message says what to do."""


def allow_open_files(settings: Settings) -> None:
    """Raise this process's limit of open files to what the settings need, if it is below that.

    Where there are too few, connections wait unseen and workers are not replaced. Raises
    TooFewFiles where the system does not allow it.
    """
    beside = FILES_BESIDE + FILES_OF_A_WORKER * settings.workers + CROWD
    needed = beside + FILES_OF_A_CONNECTION * settings.max_connections
    soft, hard = resource.getrlimit(resource.RLIMIT_NOFILE)
    if _enough(soft, needed):
        return
    if not _enough(hard, needed):
        possible = (hard - beside) // FILES_OF_A_CONNECTION
        lower = f", or lower --max-connections to {possible}" if possible > 1 else ""
        raise TooFewFiles(
            f"{settings.max_connections} connections and {settings.workers} workers need {needed} "
            f"open files, and the system allows {hard}; raise its limit (ulimit -Hn){lower}"
        )
    resource.setrlimit(resource.RLIMIT_NOFILE, (needed, hard))


def _enough(limit: int, needed: int) -> bool:
    return limit == resource.RLIM_INFINITY or limit >= needed
