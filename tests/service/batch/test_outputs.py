"""Outputs: nothing that was kept is lost or overwritten, and any form can be read."""

import csv
import io
import json
import os
from collections.abc import Callable
from pathlib import Path

import fsspec
import pyarrow.parquet
import pytest

from meshconv3d.model.loading import Limits
from meshconv3d.service.batch.classifying import run_id
from meshconv3d.service.batch.journals import InUse, LocalJournal
from meshconv3d.service.batch.outputs import Output
from meshconv3d.service.batch.tables import Csv
from meshconv3d.service.batch.targets import NotWritten, Target

RUN = run_id("1" * 64, None, Limits())


def write(path: str, outcomes: list) -> None:
    output = Output(Target(path), RUN)
    for outcome in outcomes:
        output.add(outcome)
    output.close()


def journal(path: str) -> list[dict]:
    return [json.loads(line) for line in content(path).splitlines()]


def content(path: str) -> bytes:
    fs, inner = fsspec.url_to_fs(path)
    return fs.cat_file(inner)


def test_a_file_cut_at_any_byte_is_gone_on_with(tmp_path: Path, outcome: Callable) -> None:
    """Whatever was cut off is not done; all that is left is."""
    path = tmp_path / "all.jsonl"
    outcomes = [outcome("a.obj"), outcome("b\n\u00e4.obj", "no-faces")]
    write(str(path), outcomes)
    whole = path.read_bytes()
    first = whole.index(b"\n") + 1
    for length in range(0, len(whole) + 1, 7):
        path.write_bytes(whole[:length])
        output = Output(Target(str(path)), RUN)
        left = ["0" * 64 in output.done_as(name) for name in ("a.obj", "b\n\u00e4.obj")]
        assert left == [length >= first, length == len(whole)]
        for done, again in zip(left, outcomes, strict=True):
            if not done:
                output.add(again)
        output.close()
        assert path.read_bytes() == whole


@pytest.mark.parametrize("form", ["jsonl", "csv", "parquet"])
def test_a_link_to_an_output_stays_one(tmp_path: Path, outcome: Callable, form: str) -> None:
    there, path = tmp_path / "there", tmp_path / f"all.{form}"
    path.symlink_to(there)
    for name in ("a.obj", "b.obj"):
        write(str(path), [outcome(name)])
    assert path.readlink() == there
    assert there.stat().st_size > 0


def test_who_may_read_an_output_is_for_its_owner_to_say(tmp_path: Path, outcome: Callable) -> None:
    path = tmp_path / "all.jsonl"
    path.touch()
    path.chmod(0o640)
    for name in ("a.obj", "b.obj"):
        write(str(path), [outcome(name)])
    assert len(journal(str(path))) == 2
    assert path.stat().st_mode & 0o777 == 0o640


@pytest.mark.parametrize("form", ["csv", "parquet"])
def test_any_form_is_made_anew_from_its_journal(
    tmp_path: Path, outcome: Callable, form: str
) -> None:
    path = tmp_path / f"all.{form}"
    outcomes = [outcome("a.obj"), outcome('=b,\r"\n.obj', "no-faces"), outcome("c\r.obj")]
    write(str(path), outcomes[:1])
    path.write_bytes(b"torn")
    write(str(path), outcomes[1:])
    if form == "csv":
        with path.open(newline="") as file:
            rows = list(csv.DictReader(file))
        assert list(rows[0]) == list(Csv.COLUMNS)
        assert [row["mesh.faces_in"] for row in rows] == ["12", "", "12"]
        assert [row["error.fault"] for row in rows] == ["", "no-faces", ""]
        assert json.loads(rows[0]["scores"])[0]["score"] == 1.5
    else:
        rows = pyarrow.parquet.read_table(path).to_pylist()
        assert [row["mesh"] and row["mesh"]["faces_in"] for row in rows] == [12, None, 12]
        assert rows[1]["error"]["fault"] == "no-faces"
        assert rows[0]["scores"] == [{"class": "ring", "probability": 0.5, "score": 1.5}]
    assert [row["file"] for row in rows] == ["a.obj", '=b,\r"\n.obj', "c\r.obj"]
    assert {row["run"] for row in rows} == {RUN}


@pytest.mark.parametrize("form", ["jsonl", "csv", "parquet"])
@pytest.mark.parametrize("place", ["s3", "memory"])
def test_outputs_behind_urls(
    request: pytest.FixtureRequest, outcome: Callable, place: str, form: str
) -> None:
    base = "memory://out" if place == "memory" else request.getfixturevalue("bucket")
    url = f"{base}/all.{form}"
    write(url, [outcome("a.obj"), outcome("x.obj", "deadline")])
    with pytest.raises(NotWritten, match="--resume"):
        Target(url).check(resume=False)
    output = Output(Target(url), RUN)
    assert "0" * 64 in output.done_as("a.obj")
    assert not output.done_as("x.obj")
    output.add(outcome("x.obj"))
    output.close()
    assert [line["file"] for line in journal(f"{url}.journal/00000001.jsonl")] == ["x.obj"]
    written = content(url)
    if form == "parquet":
        names = pyarrow.parquet.read_table(io.BytesIO(written)).column("file").to_pylist()
    elif form == "csv":
        names = [line.split(b",")[0].decode() for line in written.splitlines()[1:]]
    else:
        names = [json.loads(line)["file"] for line in written.splitlines()]
    assert names == ["a.obj", "x.obj"]


def test_what_another_attempt_may_change_is_done_again(tmp_path: Path, outcome: Callable) -> None:
    path = str(tmp_path / "all.jsonl")
    passing = [outcome("a.obj", "deadline"), outcome("b.obj", "unreadable", sha256=None)]
    write(path, [*passing, outcome("c.obj", "no-faces")])
    output = Output(Target(path), RUN)
    assert (output.tally.files, output.tally.reasons()) == (1, "no-faces 1")
    assert "0" * 64 in output.done_as("c.obj")
    assert [line["file"] for line in journal(path)] == ["c.obj"]


def test_a_file_named_twice_has_two_records(tmp_path: Path, outcome: Callable) -> None:
    path = str(tmp_path / "all.jsonl")
    write(path, [outcome("a.obj"), outcome("a.obj")])
    output = Output(Target(path), RUN)
    assert ["0" * 64 in output.done_as("a.obj") for _ in range(3)] == [True, True, False]


def test_a_file_that_changed_is_done_with_its_last_content(
    tmp_path: Path, outcome: Callable
) -> None:
    path = str(tmp_path / "all.jsonl")
    write(path, [outcome("a.obj"), outcome("a.obj", sha256="1" * 64)])
    output = Output(Target(path), RUN)
    assert set(output.done_as("a.obj")) == {"0" * 64, "1" * 64}


@pytest.mark.parametrize(
    ("theirs", "reason"),
    [
        (b'{"file":"a","run":"other"}\n', "another model, or with another --top"),
        (b'{"my": "data"}\n', "no records of this command"),
        (b"my data", "no records of this command"),
        (b"[1]\n", "no records of this command"),
    ],
)
def test_what_others_wrote_is_left_alone(tmp_path: Path, theirs: bytes, reason: str) -> None:
    path = tmp_path / "all.jsonl"
    path.write_bytes(theirs)
    with pytest.raises(NotWritten, match=reason):
        Output(Target(str(path)), RUN)
    assert path.read_bytes() == theirs
    assert os.listdir(tmp_path) == ["all.jsonl"]


@pytest.mark.parametrize("resume", [False, True])
def test_a_table_without_its_journal_is_left_alone(tmp_path: Path, resume: bool) -> None:
    (tmp_path / "all.csv").write_text("mine")
    with pytest.raises(NotWritten, match="without the"):
        Target(str(tmp_path / "all.csv")).check(resume)


@pytest.mark.parametrize("path", ["all.txt", "all", "all.json", "s3://bucket/all"])
def test_forms_that_are_not_written(path: str) -> None:
    with pytest.raises(NotWritten, match=r"\.jsonl, \.csv, \.parquet"):
        Target(path)


def test_two_do_not_write_the_same(tmp_path: Path, outcome: Callable) -> None:
    target = Target(str(tmp_path / "all.jsonl"))
    first = Output(target, RUN)
    first.add(outcome("a.obj"))
    with pytest.raises(InUse, match="another process writes"):
        Output(target, RUN)
    first.close()


def test_a_run_is_told_apart_by_all_that_changes_a_record() -> None:
    runs = {
        run_id(model, top, limits)
        for model in ("1" * 64, "2" * 64)
        for top in (None, 3)
        for limits in (Limits(), Limits(faces=10))
    }
    assert len(runs) == 8


def test_a_full_disk_is_told_with_the_file(tmp_path: Path) -> None:
    full = tmp_path / "all.jsonl"
    full.symlink_to("/dev/full")
    journal = LocalJournal(full)
    with pytest.raises(OSError, match="No space left") as told:
        journal.add(b"{}\n")
    assert told.value.filename == str(full)
