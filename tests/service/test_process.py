"""The inside of a worker process, in this one."""

import socket
from ctypes import c_uint64

import pytest

from meshconv3d.model.loading import Limits
from meshconv3d.service.workers import Setup, Task, process
from meshconv3d.service.workers.frames import framed

SETUP = Setup((), Limits(), memory_bytes=0, seconds=30.0)


@pytest.mark.parametrize("gone", ["warm_up", "classify"])
def test_a_worker_whose_other_end_is_gone_just_ends(
    monkeypatch: pytest.MonkeyPatch, gone: str
) -> None:
    """Whatever it does meanwhile: nobody is left to tell."""
    ours, theirs = socket.socketpair()
    ours.sendall(b"".join(framed(Task("any", b"v", None, None))))
    for step in ("warm_up", "classify"):
        monkeypatch.setattr(process, step, lambda _, last=step == gone: last and ours.close())
    with theirs:
        process.run(theirs, c_uint64(), c_uint64(), SETUP)
