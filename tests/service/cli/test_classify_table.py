"""`meshconv3d classify` at a terminal: a table that fits it."""

import re
from pathlib import Path

from tests.commands import WIDTH, at_a_terminal, sent_to_terminal


def test_a_table_with_reasons_below(model_file: Path, meshes: Path) -> None:
    status, shown = at_a_terminal("classify", ".", "--model", model_file, cwd=meshes)
    assert status == 1
    header, *rows = shown
    assert header.split() == ["File", "Class", "Probability", "Next", "Faces"]
    names = ["below/cube.OBJ", "cut.stl", "points.obj", "ring.obj", "sheet.obj"]
    assert [row.split()[0] for row in rows[:5]] == names
    assert all(len(row) <= WIDTH for row in (header, *rows[:5]))
    assert re.search(r"ring\.obj +(ball|box|ring) +\d+\.\d% .* 500$", rows[3])
    assert rows[4].endswith("512 → 500")
    assert re.fullmatch(r"points\.obj +no-faces", rows[2])
    reasons = "".join(rows[5:])
    assert "cut.stl: " in reasons
    assert "points.obj: there are no triangles" in reasons


def test_the_bar_is_gone_at_the_end_and_the_cursor_back(model_file: Path, meshes: Path) -> None:
    _, sent = sent_to_terminal("classify", ".", "--model", model_file, cwd=meshes)
    assert sent.count(b"\x1b[?25l") == sent.count(b"\x1b[?25h") > 0  # hidden, and shown again
    assert sent.rindex(b"files/s") < sent.index(b"ring.obj")


def test_top_counts_in_the_table_too(model_file: Path, meshes: Path) -> None:
    for top, others in ((1, 0), (2, 1)):
        status, (_, row, *rest) = at_a_terminal(
            "classify", "ring.obj", "--model", model_file, "--top", top, cwd=meshes
        )
        assert status == 0
        assert row.count("%") == 1 + others
        assert rest == []


def test_json_on_request(model_file: Path, meshes: Path) -> None:
    _, (line,) = at_a_terminal("classify", "ring.obj", "--json", "--model", model_file, cwd=meshes)
    assert line.startswith('{"file":"ring.obj","class":')


def test_a_file_name_commands_nothing(model_file: Path, tmp_path: Path) -> None:
    (tmp_path / "[bold]\x1b[2J\x07.obj").write_text("v 0 0 0\n")
    _, shown = at_a_terminal("classify", ".", "--model", model_file, cwd=tmp_path)
    assert shown[1].startswith("[bold]\ufffd[2J\ufffd.obj ")
    assert shown[2].startswith("[bold]\ufffd[2J\ufffd.obj: there are no triangles")
