"""The installed `meshconv3d` as a program of its own."""

import os
import subprocess
import sys
from collections.abc import Mapping
from pathlib import Path

PROGRAM = str(Path(sys.executable).with_name("meshconv3d"))


def environment(**changes: str) -> dict[str, str]:
    """This process's environment without the project's variables, and with `changes`."""
    kept = {name: value for name, value in os.environ.items() if "MESHCONV3D" not in name}
    return kept | {"TERM": "xterm"} | changes


def meshconv3d(
    *arguments: object, stdin: bytes = b"", variables: Mapping[str, str] = {}
) -> subprocess.CompletedProcess[str]:
    """Run it with its output piped; stdout and stderr come back as text."""
    command = [PROGRAM, *map(str, arguments)]
    done = subprocess.run(
        command, input=stdin, capture_output=True, env=environment(**variables), timeout=120
    )
    return subprocess.CompletedProcess(
        command, done.returncode, done.stdout.decode(), done.stderr.decode()
    )


def read_terminal(master: int) -> bytes:
    """All that is written to a pseudo-terminal until its other side is closed; closes this one."""
    output = b""
    with open(master, "rb", buffering=0) as terminal:
        while True:
            try:
                chunk = terminal.read(65536)
            except OSError:  # how Linux tells that the other side was closed
                return output
            if not chunk:
                return output
            output += chunk
