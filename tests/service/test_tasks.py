"""The program of a worker process, run in this one."""

import pickle
import socket
from unittest.mock import MagicMock

import pytest

from meshconv3d.model.loading import Limits
from meshconv3d.service.workers import Setup, Task, tasks

SETUP = Setup((), Limits(), memory_bytes=0, seconds=30.0)


@pytest.mark.parametrize("gone", ["warm_up", "answer_to"])
def test_a_worker_whose_service_is_gone_ends_without_an_error(
    monkeypatch: pytest.MonkeyPatch, gone: str
) -> None:
    ours, theirs = socket.socketpair()
    ours.sendall(pickle.dumps(Task("any", b"v", None, None)))

    def step(name: str) -> object:
        if name == gone:
            ours.close()
        return {}

    # Nothing that would outlast the test in this process.
    monkeypatch.setattr(tasks.signal, "signal", lambda *_: None)
    for name in ("limit_memory", "limit_cpu", "Path"):
        monkeypatch.setattr(tasks, name, lambda *_: MagicMock())
    monkeypatch.setattr(tasks, "warm_up", lambda *_: step("warm_up"))
    monkeypatch.setattr(tasks, "answer_to", lambda *_: step("answer_to"))
    with theirs:
        tasks.work(theirs, SETUP)
