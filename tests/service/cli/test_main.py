"""What `meshconv3d` does whatever the command."""

from pathlib import Path

import pytest

from meshconv3d.service.cli import main
from tests.articulated import sample_paths
from tests.commands import sent_to_terminal


@pytest.mark.parametrize(
    ("command", "encoding"), [("classify", "ascii"), ("evaluate", "iso8859-1")]
)
def test_a_terminal_that_is_not_utf8(
    model_file: Path, tmp_path: Path, encoding: str, command: str
) -> None:
    """Progress bar and table are printed in what the terminal has."""
    (tmp_path / "ring").mkdir()
    for name in ("glasses", "ants"):
        (tmp_path / "ring" / f"\u017e\u2192{name}.ply").write_bytes(
            sample_paths()[name].read_bytes()
        )
    call = ["classify", ".", "--model", model_file]
    if command == "evaluate":
        call = ["evaluate", model_file, "."]
    status, sent = sent_to_terminal(
        *call, cwd=tmp_path, variables={"PYTHONIOENCODING": encoding, "COLUMNS": "200"}
    )
    assert status == 1  # that of one file: an OBJ is no PLY
    assert b"Traceback" not in sent
    assert b"?->ants.ply" in sent


@pytest.mark.parametrize("error", [MemoryError(), RuntimeError("can't start new thread")])
def test_too_little_memory_is_told_in_a_line(
    error: Exception, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def fail(**_: object) -> None:
        raise error

    monkeypatch.setattr(main, "commands", fail)
    with pytest.raises(SystemExit) as caught:
        main.main()
    assert caught.value.code == 1
    assert capsys.readouterr().err == "Error: there is not enough memory (see ulimit -v)\n"


def test_another_runtime_error_is_not_hidden(monkeypatch: pytest.MonkeyPatch) -> None:
    def fail(**_: object) -> None:
        raise RuntimeError("broken")

    monkeypatch.setattr(main, "commands", fail)
    with pytest.raises(RuntimeError, match="broken"):
        main.main()
