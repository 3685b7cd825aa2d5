"""Which figures of two runs count as worse."""

import pytest

from benchmarks.__main__ import main
from benchmarks.comparison import changes, compare
from benchmarks.suite import Run
from tests.benchmarks.runs import findings, run_of


def ratios(before, after):
    return {change.name: change.ratio for change in changes(run_of(a=before), run_of(a=after))}


def test_times_are_compared_in_yardsticks_and_all_else_as_it_is():
    before = findings(20.0, time=(2.0, "ms"), memory=(100.0, "MB"), share=(0.5, "of 1"))
    after = findings(40.0, time=(4.0, "ms"), memory=(150.0, "MB"), share=(0.5, "of 1"))
    assert ratios(before, after) == pytest.approx({"a: time": 1, "a: memory": 1.5, "a: share": 1})


def test_what_only_one_run_has_is_not_compared():
    before, after = findings(time=(2.0, "ms"), old=(1.0, "ms")), findings(time=(2.0, "ms"))
    assert list(ratios(before, after)) == ["a: time"]
    with pytest.raises(ValueError, match="no figure in common"):
        compare(run_of(a=before), run_of(b=after), 0.2)


@pytest.mark.parametrize(("value", "same"), [(1.0, True), (2.3, True), (2.5, False)])
def test_a_figure_is_worse_beyond_the_tolerance(value, same, capsys):
    before, after = findings(time=(2.0, "ms")), findings(time=(value, "ms"))
    assert compare(run_of(a=before), run_of(a=after), 0.2) is same
    assert ("worse\n" in capsys.readouterr().out) is not same


def test_a_run_is_what_was_written_and_the_command_exits_1_on_a_regression(tmp_path, monkeypatch):
    paths = tmp_path / "before.json", tmp_path / "after.json"
    runs = run_of(a=findings(time=(2.0, "ms"))), run_of(a=findings(time=(3.0, "ms")))
    for path, run in zip(paths, runs, strict=True):
        run.write(path)
        assert Run.read(path) == run
    for order, code in ((paths, 1), (paths[::-1], 0)):
        monkeypatch.setattr("sys.argv", ["benchmarks", "compare", *map(str, order)])
        with pytest.raises(SystemExit) as end:
            main()
        assert end.value.code == code


@pytest.mark.parametrize("content", ["", "[]", "{}", '{"benchmarks": {"a": 1}}'])
def test_another_file_is_refused_in_one_line(content, tmp_path, monkeypatch, capsys):
    path = tmp_path / "file.json"
    path.write_text(content)
    monkeypatch.setattr("sys.argv", ["benchmarks", "compare", str(path), str(path)])
    with pytest.raises(SystemExit) as end:
        main()
    assert end.value.code == 2
    assert "is no result of `python -m benchmarks`" in capsys.readouterr().err
