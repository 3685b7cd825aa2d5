"""`meshconv3d evaluate`: what a model is worth, by the answers that `classify` would give."""

import json
import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from tests.articulated import sample_paths
from tests.commands import WIDTH, at_a_terminal, environment, meshconv3d

LABELS = {"two_balls": "ball", "ants": "ball", "laptop": "box", "lamp": "box", "snake": "ring"}
"""A class of the small model for some samples; what it answers does not matter."""
FILES = ["report.json", "confusion.png", "predictions.jsonl"]


def without_drawing(*arguments: object) -> subprocess.CompletedProcess[str]:
    """The command line where matplotlib is not installed."""
    program = """
import sys
sys.modules["matplotlib"] = None
from meshconv3d.service.cli.main import main
main()
"""
    command = [sys.executable, "-c", program, *map(str, arguments)]
    return subprocess.run(command, capture_output=True, text=True, env=environment(), timeout=120)


@pytest.fixture(scope="module")
def labelled(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Five samples as CLASS/test/file, without anything to train on."""
    folder = tmp_path_factory.mktemp("labelled")
    for sample, label in LABELS.items():
        place = folder / label / "test"
        place.mkdir(parents=True, exist_ok=True)
        shutil.copy(sample_paths()[sample], place)
    return folder


@pytest.fixture
def flawed(labelled: Path, tmp_path: Path) -> Path:
    """The same, with two files that are no mesh."""
    folder = tmp_path / "flawed"
    shutil.copytree(labelled, folder)
    (folder / "box" / "test" / "points.obj").write_text("v 0 0 0\n")
    (folder / "ring" / "test" / "cut.stl").write_bytes(b"\0" * 10)
    return folder


@pytest.fixture(scope="module")
def classified(model_file: Path, labelled: Path) -> list[dict]:
    """What `classify` says of every file, in the order of their paths."""
    done = meshconv3d("classify", labelled, "--model", model_file)
    return [json.loads(line) for line in done.stdout.splitlines()]


def untimed(record: dict) -> dict:
    return {name: value for name, value in record.items() if name != "timings_ms"}


def test_the_report_counts_what_classify_answers(
    model_file: Path, labelled: Path, classified: list[dict]
) -> None:
    done = meshconv3d("evaluate", model_file, labelled)
    assert (done.returncode, done.stderr) == (0, "")
    report = json.loads(done.stdout)
    assert report["model"] == classified[0]["model"]
    assert report["data"] == {"folder": str(labelled), "split_file": None, "part": "test"}
    assert (report["files"], report["refused"], report["reasons"]) == (5, 0, {})

    truths = [Path(record["file"]).parts[-3] for record in classified]
    answers = [record["class"] for record in classified]
    right = [truth == answer for truth, answer in zip(truths, answers, strict=True)]
    assert report["accuracy"] == pytest.approx(np.mean(right))
    assert report["top5_accuracy"] is None  # there are three classes
    stated = [
        next(score["probability"] for score in record["scores"] if score["class"] == truth)
        for record, truth in zip(classified, truths, strict=True)
    ]
    assert report["negative_log_likelihood"] == pytest.approx(-np.log(stated).mean(), abs=1e-3)
    assert report["calibration_bins"] == 15
    assert 0 <= report["calibration_error"] <= 1

    names = [figures["class"] for figures in report["classes"]]
    assert names == ["ball", "box", "ring"]
    assert [figures["files"] for figures in report["classes"]] == [2, 2, 1]
    expected = np.zeros((3, 3), dtype=int)
    for truth, answer in zip(truths, answers, strict=True):
        expected[names.index(truth), names.index(answer)] += 1
    assert report["confusion"] == expected.tolist()
    recalls = [figures["recall"] for figures in report["classes"]]
    assert recalls == pytest.approx(expected.diagonal() / expected.sum(axis=1))
    assert report["balanced_accuracy"] == pytest.approx(np.mean(recalls), abs=1e-6)
    for figures, row in zip(report["classes"], expected, strict=True):
        others = {n: int(c) for n, c in zip(names, row, strict=True) if n != figures["class"]}
        mistake = figures["mistaken_for"] or {"class": names[0], "files": 0}
        assert mistake["files"] == max(others.values())
        assert others.get(mistake["class"], 0) == mistake["files"]

    stages = report["timing"]["stages_ms"]
    assert list(stages) == ["read", "prepare", "topology", "infer", "total"]
    assert all(0 < stage["median"] <= stage["p95"] for stage in stages.values())
    assert report["timing"]["files_per_second"] > 0


def test_refused_files_are_wrong_and_counted_by_reason(model_file: Path, flawed: Path) -> None:
    done = meshconv3d("evaluate", model_file, flawed)
    assert (done.returncode, done.stderr) == (1, "")
    report = json.loads(done.stdout)
    assert (report["files"], report["refused"]) == (7, 2)
    assert report["reasons"] == {"no-faces": 1, "truncated": 1}
    assert [figures["refused"] for figures in report["classes"]] == [0, 1, 1]
    right = np.trace(report["confusion"])
    assert report["accuracy"] == pytest.approx(right / 7, abs=1e-6)
    assert np.sum(report["confusion"]) == 5


def test_nothing_but_refused_files_is_a_report_too(model_file: Path, tmp_path: Path) -> None:
    (tmp_path / "box").mkdir()
    (tmp_path / "box" / "points.obj").write_text("v 0 0 0\n")
    done = meshconv3d("evaluate", model_file, tmp_path, "--out", tmp_path / "out")
    assert (done.returncode, done.stderr) == (1, "")
    report = json.loads(done.stdout)
    assert report["accuracy"] == report["balanced_accuracy"] == 0
    for figure in ("calibration_error", "negative_log_likelihood", "timing"):
        assert report[figure] is None
    status, shown = at_a_terminal("evaluate", model_file, ".", cwd=tmp_path)
    assert status == 1
    assert "no-faces 1" in "\n".join(shown)


def test_out_holds_the_report_a_picture_and_every_answer(
    model_file: Path, flawed: Path, classified: list[dict], tmp_path: Path
) -> None:
    out = tmp_path / "new" / "folder"
    done = meshconv3d("evaluate", model_file, flawed, "--out", out)
    assert (done.returncode, done.stderr) == (1, "")
    assert sorted(path.name for path in out.iterdir()) == sorted(FILES)
    assert (out / "report.json").read_text() == done.stdout
    assert (out / "confusion.png").read_bytes().startswith(b"\x89PNG")

    lines = (out / "predictions.jsonl").read_text().splitlines()
    records = [json.loads(line) for line in lines]
    assert [record["file"] for record in records] == sorted(map(str, flawed.glob("*/test/*")))
    assert all(record.pop("truth") == Path(record["file"]).parts[-3] for record in records)
    refused = {Path(r["file"]).name: r["error"]["fault"] for r in records if "error" in r}
    assert refused == {"points.obj": "no-faces", "cut.stl": "truncated"}
    answered = [record for record in records if "error" not in record]
    names = [Path(record["file"]).name for record in answered]
    assert names == [Path(record["file"]).name for record in classified]
    for record, same in zip(answered, classified, strict=True):
        assert untimed(record) | {"file": None} == untimed(same) | {"file": None}


def test_a_folder_without_splits(model_file: Path, labelled: Path, tmp_path: Path) -> None:
    for path in labelled.glob("*/test/*"):
        place = tmp_path / path.parts[-3]
        place.mkdir(exist_ok=True)
        shutil.copy(path, place)
    reports = [
        json.loads(meshconv3d("evaluate", model_file, folder).stdout)
        for folder in (labelled, tmp_path)
    ]
    for figure in ("files", "accuracy", "calibration_error", "confusion"):
        assert reports[0][figure] == reports[1][figure]


def test_a_table_chooses_the_files(model_file: Path, labelled: Path, tmp_path: Path) -> None:
    table = tmp_path / "split.csv"
    table.write_text("class,file,split\nball,ants.obj,val\nring,snake.3mf,val\nbox,lamp.obj,test\n")
    done = meshconv3d("evaluate", model_file, labelled, "--split", table, "--part", "val")
    report = json.loads(done.stdout)
    assert report["data"]["split_file"] == str(table)
    assert report["data"]["part"] == "val"
    assert [figures["files"] for figures in report["classes"]] == [1, 0, 1]
    assert report["classes"][1]["recall"] is None


@pytest.mark.parametrize(
    ("arguments", "reason"),
    [
        (["{model}"], "Missing argument 'DATA'"),
        (["{model}", "{labelled}/nothing"], "does not exist"),
        (["nothing", "{labelled}"], "no model 'nothing'"),
        (["{model}", "{empty}"], "expected {empty}/CLASS/test/*.obj or {empty}/CLASS/*.obj"),
        (["{model}", "{labelled}", "--part", "val"], "no meshes of the part val under"),
        (["{model}", "{labelled}", "--part", "val"], "choose --part test"),
        (["{model}", "{labelled}", "--part", "all"], "Invalid value for '--part'"),
        (["{model}", "{labelled}", "--split", "{table}"], "lacks the columns class,file,split"),
        (["{model}", "{other}"], "that the model does not know: key, watch (meshconv3d inspect"),
        (["{model}", "{labelled}", "--out", "{table}"], "is a file"),
    ],
)
def test_a_wrong_call_is_exit_2_and_says_why(
    model_file: Path, labelled: Path, tmp_path: Path, arguments: list[str], reason: str
) -> None:
    places = {
        "model": model_file,
        "labelled": labelled,
        **{name: tmp_path / name for name in ("empty", "table", "other", "out")},
    }
    places["empty"].mkdir()
    places["table"].write_text("class,file\n")
    for label in ("watch", "key", "box"):
        (places["other"] / label).mkdir(parents=True)
        shutil.copy(sample_paths()["ants"], places["other"] / label)
    given = [argument.format(**places) for argument in arguments]
    if "--out" not in given:
        given += ["--out", str(places["out"])]
    done = meshconv3d("evaluate", *given)
    assert done.returncode == 2
    assert done.stdout == ""
    assert reason.format(**places) in done.stderr
    assert not places["out"].exists()


def test_without_what_draws_it_says_so_before_it_works(
    model_file: Path, labelled: Path, tmp_path: Path
) -> None:
    out = tmp_path / "out"
    done = without_drawing("evaluate", model_file, labelled, "--out", out)
    assert (done.returncode, done.stdout) == (2, "")
    (line,) = done.stderr.splitlines()
    assert "matplotlib" in line
    assert "pip install 'meshconv3d[train]'" in line
    assert not out.exists()


def test_measuring_alone_needs_nothing_that_draws(model_file: Path, labelled: Path) -> None:
    done = without_drawing("evaluate", model_file, labelled)
    assert (done.returncode, done.stderr) == (0, "")
    assert json.loads(done.stdout)["files"] == 5


def test_tables_at_a_terminal(model_file: Path, flawed: Path) -> None:
    status, shown = at_a_terminal("evaluate", model_file, ".", cwd=flawed)
    assert status == 1
    assert all(len(line) <= WIDTH for line in shown[:-2])
    text = "\n".join(shown)
    for heading in ("Accuracy", "Balanced accuracy", "Refused", "Calibration error"):
        assert heading in text
    assert "Top-5" not in text
    assert "of 7 files" in text
    assert "15 of equal width" in " ".join(text.split())
    assert [line.split()[0] for line in shown if " ms " in line][-1] == "total"
    start = next(i for i, line in enumerate(shown) if line.startswith("Class "))
    assert [line.split()[:3] for line in shown[start + 1 : start + 4]] == [
        ["ball", "2", "0"],
        ["box", "3", "1"],
        ["ring", "2", "1"],
    ]
    assert shown[-2].startswith("box/test/points.obj: there are no triangles")
    assert shown[-1].startswith("ring/test/cut.stl: ")


def test_json_on_request(model_file: Path, labelled: Path) -> None:
    _, (line,) = at_a_terminal("evaluate", model_file, ".", "--json", cwd=labelled)
    assert json.loads(line)["files"] == 5


def test_the_shipped_model_on_real_meshes(shrec: Path, tmp_path: Path) -> None:
    """A few files of six classes, all of which it knows."""
    labels = ["alien", "ants", "cat", "hand", "shark", "woman"]
    rows = [
        f"{label},{path.name},test"
        for label in labels
        for path in sorted((shrec / label / "test").iterdir())[:2]
    ]
    table = tmp_path / "split.csv"
    table.write_text("\n".join(["class,file,split", *rows]))
    done = meshconv3d("evaluate", "shrec11", shrec, "--split", table)
    assert (done.returncode, done.stderr) == (0, "")
    report = json.loads(done.stdout)
    assert report["files"] == 12
    assert report["accuracy"] == report["top5_accuracy"] == report["balanced_accuracy"] == 1
