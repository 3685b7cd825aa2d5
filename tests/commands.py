"""`meshconv3d` as a program of its own, and called in this process."""

import contextlib
import fcntl
import io
import os
import pty
import re
import signal
import struct
import subprocess
import sys
import termios
from collections.abc import Mapping
from pathlib import Path
from unittest import mock

from meshconv3d.service.cli.main import main

PROGRAM = str(Path(sys.executable).with_name("meshconv3d"))
WIDTH = 80


def environment(**changes: str) -> dict[str, str]:
    """This process's environment without the project's variables, and with `changes`."""
    kept = {name: value for name, value in os.environ.items() if "MESHCONV3D" not in name}
    return kept | {"TERM": "xterm"} | changes


def program(
    *arguments: object, stdin: bytes = b"", variables: Mapping[str, str] = {}
) -> subprocess.CompletedProcess[str]:
    """Run the installed program with its output piped; stdout and stderr come back as text."""
    command = [PROGRAM, *map(str, arguments)]
    done = subprocess.run(
        command, input=stdin, capture_output=True, env=environment(**variables), timeout=120
    )
    return subprocess.CompletedProcess(
        command, done.returncode, done.stdout.decode(), done.stderr.decode()
    )


def meshconv3d(
    *arguments: object, stdin: bytes = b"", variables: Mapping[str, str] = {}
) -> subprocess.CompletedProcess[str]:
    """Call it in this process, which saves a start; the same comes back."""
    command = ["meshconv3d", *map(str, arguments)]
    source, out, err = (io.TextIOWrapper(io.BytesIO(data), "utf-8") for data in (stdin, b"", b""))
    with (
        mock.patch.object(sys, "argv", command),
        mock.patch.object(sys, "stdin", source),
        mock.patch.dict(os.environ, environment(**variables), clear=True),
        contextlib.redirect_stdout(out),
        contextlib.redirect_stderr(err),
    ):
        try:
            main()
            status = 0
        except SystemExit as end:
            status = int(end.code or 0)
        out.flush()
        err.flush()
    texts = (stream.buffer.getvalue().decode() for stream in (out, err))
    return subprocess.CompletedProcess(command, status, *texts)


def interruptible(*arguments: object, variables: Mapping[str, str] = {}) -> subprocess.Popen[str]:
    """Begin it with its output piped, in a session of its own, where signals do what they do at a
    terminal, whatever they do to the tests."""
    return subprocess.Popen(
        [PROGRAM, *map(str, arguments)],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        env=environment(**variables),
        start_new_session=True,
        preexec_fn=lambda: signal.signal(signal.SIGINT, signal.SIG_DFL),
    )


def at_a_terminal(*arguments: object, cwd: Path) -> tuple[int, list[str]]:
    """Exit code and what stands on a terminal of 80 columns, without its control codes."""
    status, output = sent_to_terminal(*arguments, cwd=cwd, errors=False)
    assert not re.search(rb"\x1b\[[0-9;?]*[^0-9;?m]", output)  # colours, and nothing else
    shown = re.sub(r"\x1b\[[0-9;]*m", "", output.decode())
    return status, [line.rstrip() for line in shown.splitlines()]


def sent_to_terminal(
    *arguments: object, cwd: Path, errors: bool = True, variables: Mapping[str, str] = {}
) -> tuple[int, bytes]:
    """Exit code and all that a terminal of 80 columns is sent. errors: standard error, too."""
    master, slave = pty.openpty()
    fcntl.ioctl(slave, termios.TIOCSWINSZ, struct.pack("HHHH", 24, WIDTH, 0, 0))
    process = subprocess.Popen(
        [PROGRAM, *map(str, arguments)],
        stdin=slave,
        stdout=slave,
        stderr=slave if errors else subprocess.DEVNULL,
        env=environment(**variables),
        cwd=cwd,
    )
    os.close(slave)
    output = read_terminal(master)
    return process.wait(60), output


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
