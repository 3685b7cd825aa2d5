"""Ctrl-C at an unlucky moment."""

import os
import signal
import time
from collections.abc import Callable
from pathlib import Path

import pytest

from meshconv3d.service.cli import main
from tests.commands import interruptible
from tests.processes import children, until, workers


def interrupted_in_compiled_code() -> None:
    """Raises what numba makes of an interrupt: errors, each the cause of the next."""
    try:
        try:
            raise KeyboardInterrupt
        except KeyboardInterrupt as interrupt:
            raise SystemError("returned a result with an exception set") from interrupt
    except SystemError as error:
        raise SystemError("again") from error


def test_an_interrupt_in_compiled_code_is_one(monkeypatch, capsys):
    monkeypatch.setattr(main, "commands", lambda **_: interrupted_in_compiled_code())
    with pytest.raises(SystemExit) as caught:
        main.main()
    assert caught.value.code == 130
    assert capsys.readouterr().err.splitlines()[-1] == "interrupted"


def test_another_system_error_is_not_hidden(monkeypatch):
    def fail(**_: object) -> None:
        raise SystemError("broken")

    monkeypatch.setattr(main, "commands", fail)
    with pytest.raises(SystemError, match="broken"):
        main.main()


@pytest.mark.parametrize(("begun", "seconds"), [(children, 0.0), (children, 0.3), (workers, 0.1)])
def test_an_interrupt_as_workers_start_is_told_in_a_word(
    model_file: Path, begun: Callable[[int], list[int]], seconds: float
) -> None:
    """A terminal interrupts all processes at once."""
    process = interruptible("serve", "--port", "0", "--model", model_file)
    until(lambda: begun(process.pid))
    time.sleep(seconds)
    os.killpg(process.pid, signal.SIGINT)
    _, said = process.communicate(timeout=90)
    assert "Traceback" not in said
    assert process.returncode in (0, 130)


def test_a_stop_as_libraries_are_compiled_is_told_in_a_word(tmp_path: Path) -> None:
    """Nor does what came from it go on compiling, for workers that nobody asks for any more."""
    process = interruptible("serve", "--port", "0", variables={"NUMBA_CACHE_DIR": str(tmp_path)})
    until(lambda: len(children(process.pid)) == 2)  # the second forks them, once it can
    time.sleep(1)  # until it is asked for them
    process.send_signal(signal.SIGTERM)
    _, said = process.communicate(timeout=20)  # until all that came from it are gone
    assert "Traceback" not in said
    assert process.returncode == 0
