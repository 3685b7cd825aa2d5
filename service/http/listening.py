"""The sockets that the service listens at."""

import asyncio
import errno
import socket

# Connections that wait to be taken, before the system refuses more.
BACKLOG = 2048

# Why an address cannot be had, and what to do.
REASONS = {
    errno.EADDRINUSE: "the port is taken; choose another with --port, or 0 for a free one",
    errno.EACCES: "the port is not for everyone, as those below 1024 are not; choose another with "
    "--port, such as 8000",
    errno.EADDRNOTAVAIL: "that is no address of this machine; --host takes one of its own, or "
    "0.0.0.0 for all",
}


class CannotListen(Exception):
    """An address at which the service cannot listen. The message says why, and what to do."""


def listen(host: str, port: int) -> list[socket.socket]:
    """A socket that listens for each address of a host; port 0 is a free one.

    Raises CannotListen.
    """
    try:
        return asyncio.run(_listen(host, port))
    except socket.gaierror:
        reason = "that is no host; --host takes an address of this machine, or 0.0.0.0 for all"
    except OSError as error:
        reason = REASONS.get(error.errno or 0, str(error))
    raise CannotListen(f"cannot listen at {host}, port {port}: {reason}")


async def _listen(host: str, port: int) -> list[socket.socket]:
    loop = asyncio.get_running_loop()
    bound = await loop.create_server(asyncio.Protocol, host, port, start_serving=False)
    sockets = [each.dup() for each in bound.sockets]  # they outlive this loop
    bound.close()
    for each in sockets:
        each.listen(BACKLOG)
    return sockets


def address(listening: socket.socket) -> str:
    """The address of a socket as it is asked for in a browser."""
    host, port = listening.getsockname()[:2]
    return f"http://[{host}]:{port}" if ":" in host else f"http://{host}:{port}"
