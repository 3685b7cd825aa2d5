"""`meshconv3d page`: what it writes, and what it refuses."""

import json
import re
import sys
from pathlib import Path

import pytest
from click.testing import CliRunner, Result

from meshconv3d.service.cli.main import commands
from meshconv3d.service.static_page import NotWritten, check_folder


def page(*arguments: object) -> Result:
    return CliRunner().invoke(commands, ["page", *map(str, arguments)])


def test_a_folder_with_other_content_stays(tmp_path: Path) -> None:
    (tmp_path / "index.html").write_text("mine")
    done = page("--out", tmp_path)
    assert done.exit_code == 2
    assert "is not empty, and holds no such page" in done.output
    assert [path.name for path in tmp_path.iterdir()] == ["index.html"]


def test_folders_that_cannot_be_written(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    with pytest.raises(NotWritten, match="is a file"):
        check_folder(tmp_path / "file")
    with pytest.raises(NotWritten, match="there is no folder"):
        check_folder(tmp_path / "none" / "below")
    (tmp_path / "empty").mkdir()
    check_folder(tmp_path / "empty")
    check_folder(tmp_path / "new")


@pytest.mark.parametrize(
    ("options", "reason"),
    [
        (["--model", "cups"], "no model 'cups'"),
        (["--model", "shrec11", "--model", "shrec11"], "with another --name"),
        (["--library", "none.parquet"], "does not exist"),
    ],
)
def test_mistakes_in_the_call(tmp_path: Path, options: list[str], reason: str) -> None:
    done = page("--out", tmp_path / "site", *options)
    assert done.exit_code == 2
    assert reason in done.output
    assert not (tmp_path / "site").exists()


def test_the_extra_is_named(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "onnx", None)
    monkeypatch.delitem(sys.modules, "meshconv3d.service.static_page")
    done = page("--out", tmp_path / "site")
    assert done.exit_code == 2
    assert "pip install 'meshconv3d[teach]'" in done.output


def test_a_build_replaces_the_one_before(model_file: Path, tmp_path: Path) -> None:
    """What only the earlier one had goes; files that are not of a build stay."""
    site = tmp_path / "site"
    done = page("--out", site, "--model", model_file)
    assert done.exit_code == 0, done.output
    assert f"try it: python -m http.server --directory {site}" in done.output
    for stale in ("models/other.onnx", "assets/old.js", "library/pictures/7.png"):
        (site / stale).parent.mkdir(parents=True, exist_ok=True)
        (site / stale).write_text("old")
    (site / "robots.txt").write_text("mine")
    before = (site / "index.html").read_text()
    assert page("--out", site, "--model", model_file).exit_code == 0
    assert (site / "index.html").read_text() == before  # of the same content
    left = {path.relative_to(site).as_posix() for path in site.rglob("*") if path.is_file()}
    assert {path for path in left if path.startswith("models/")} == {"models/tiny.onnx"}
    assert not left & {"assets/old.js", "library/pictures/7.png"}
    assert "robots.txt" in left
    assert not any("docs" in path for path in left)


def test_the_page_names_only_its_own_files(model_file: Path, tmp_path: Path) -> None:
    site = tmp_path / "site"
    assert page("--out", site, "--model", model_file).exit_code == 0
    text = (site / "index.html").read_text()
    policy = re.search(r'Content-Security-Policy" content="([^"]+)"', text)
    assert policy
    assert "unsafe" not in policy[1].replace("'wasm-unsafe-eval'", "")
    assert "http" not in policy[1]
    build = re.search(r'meshconv3d-build" content="([^"?]+)\?v=', text)
    assert build
    described = json.loads((site / build[1]).read_text())
    files = [described["runtime"], *described["models"], *described["samples"]]
    for file in files:
        assert (site / file["path"].partition("?")[0]).stat().st_size == file["bytes"]
    (model,) = described["models"]
    assert model["name"] == "tiny"
    assert described["library"] is None
