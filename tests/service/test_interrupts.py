"""Ctrl-C at an unlucky moment."""

import pytest

from service.cli import main


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
