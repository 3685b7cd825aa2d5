"""Files that several machines read."""

from pathlib import Path

import pytest

from meshconv3d.service.batch.local import LocalFile
from meshconv3d.service.batch.shared import SharedFile


def test_a_file_is_the_same_from_any_folder(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "a.obj").write_text("content")
    monkeypatch.chdir(tmp_path)
    file = SharedFile.of(LocalFile("a.obj"))
    monkeypatch.chdir("/")
    assert (file.name, file.below, file.declared) == ("a.obj", "a.obj", ".obj")
    assert (file.size(), file.read()) == (7, b"content")


def test_a_machine_that_lacks_a_file_says_what_to_do(tmp_path: Path) -> None:
    missing = LocalFile(str(tmp_path / "a.obj"))
    elsewhere = SharedFile("a.obj", missing, host="elsewhere")
    with pytest.raises(FileNotFoundError, match=r"elsewhere has it and .* has not; put"):
        elsewhere.read()
    with pytest.raises(FileNotFoundError, match="No such file"):
        SharedFile.of(missing).read()
