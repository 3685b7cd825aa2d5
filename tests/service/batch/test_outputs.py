"""Outputs: nothing that was kept is lost or overwritten, and any form can be read."""

import csv
import io
import json
import os
import resource
from pathlib import Path

import fsspec
import pyarrow.parquet
import pytest

from meshconv3d.model.loading import Limits
from meshconv3d.service.attribution import explain
from meshconv3d.service.batch.outputs import CSV_COLUMNS, FORMS, Output
from meshconv3d.service.batch.resume import LONGEST_LINE, NotWritten, entry
from meshconv3d.service.batch.running import run_id
from meshconv3d.service.classifier import Classifier
from meshconv3d.service.records import answer as record_of
from tests.articulated import sample_paths
from tests.service.batch.records import Added, added, answer, refusal

RUN = run_id("1" * 64, None, Limits())


def begun(path: object, run: str = RUN) -> Output:
    """An output that goes on."""
    output = Output(str(path), resume=True)
    list(output.begin(run))
    return output


def write(path: object, *records: Added) -> None:
    with begun(path) as output:
        for record, sha256 in records:
            output.add(record, sha256)


def interrupted(path: object, *records: Added) -> None:
    """Write, and end before all is done."""
    output = begun(path)
    output.__enter__()
    for record, sha256 in records:
        output.add(record, sha256)
    output.__exit__(KeyboardInterrupt)


def lines(path: object) -> list[dict]:
    return [json.loads(line) for line in content(path).splitlines()]


def content(path: object) -> bytes:
    fs, inner = fsspec.url_to_fs(str(path))
    return fs.cat_file(inner)


def test_a_file_cut_at_any_byte_is_gone_on_with(tmp_path: Path) -> None:
    """Whatever was cut off is not done; all that is left is. Some systems end a file that was
    written as the power went with zeros."""
    path = tmp_path / "all.jsonl"
    records = [added("a.obj"), added("b\n\u00e4.obj", "no-faces")]
    write(path, *records)
    whole = path.read_bytes()
    first = whole.index(b"\n") + 1
    for length in range(0, len(whole) + 1, 17):
        path.write_bytes(whole[:length] + bytes(length % 3))
        with begun(path) as output:
            left = ["0" * 64 in output.done_as(name) for name in ("a.obj", "b\n\u00e4.obj")]
            assert left == [length >= first, length == len(whole)]
            for done, again in zip(left, records, strict=True):
                if not done:
                    output.add(*again)
        assert path.read_bytes() == whole


def test_who_may_read_an_output_is_for_its_owner_to_say(tmp_path: Path) -> None:
    path = tmp_path / "all.jsonl"
    path.touch()
    path.chmod(0o640)
    for name in ("a.obj", "b.obj"):
        write(path, added(name))
    assert len(lines(path)) == 2
    assert path.stat().st_mode & 0o777 == 0o640


@pytest.mark.parametrize("form", ["csv", "parquet"])
def test_any_form_is_made_from_its_journal_which_then_goes(tmp_path: Path, form: str) -> None:
    path = tmp_path / f"all.{form}"
    names = ["a.obj", 'b,\r"\n.obj', "c\r.obj"]
    interrupted(path, added(names[0]))
    assert not path.exists()
    path.write_bytes(b"torn")
    write(path, added(names[1], "no-faces"), added(names[2]))
    assert os.listdir(tmp_path) == [path.name]
    if form == "csv":
        with path.open(newline="") as file:
            rows = list(csv.DictReader(file))
        assert list(rows[0]) == list(CSV_COLUMNS)
        assert [row["mesh.faces_in"] for row in rows] == ["1200", "", "1200"]
        assert [row["error.fault"] for row in rows] == ["", "no-faces", ""]
        assert json.loads(rows[0]["scores"])[0]["score"] == 0.9
    else:
        rows = pyarrow.parquet.read_table(path).to_pylist()
        assert [row["mesh"] and row["mesh"]["faces_in"] for row in rows] == [1200, None, 1200]
        assert rows[1]["error"]["fault"] == "no-faces"
        assert rows[0]["scores"][0] == {"class": "ring", "probability": 0.9, "score": 0.9}
    assert [row["file"] for row in rows] == names
    assert {row["run"] for row in rows} == {RUN}


def test_a_journal_stays_while_another_attempt_may_change_a_record(tmp_path: Path) -> None:
    path = tmp_path / "all.csv"
    write(path, added("a.obj"), added("b.obj", "deadline"))
    assert len(path.read_text().splitlines()) == 3
    write(path, added("b.obj"))
    assert os.listdir(tmp_path) == [path.name]
    assert ",deadline," not in path.read_text()


@pytest.mark.parametrize("form", ["jsonl", "csv", "parquet"])
@pytest.mark.parametrize("place", ["s3", "memory"])
def test_outputs_behind_urls(request: pytest.FixtureRequest, place: str, form: str) -> None:
    base = "memory://out" if place == "memory" else request.getfixturevalue("bucket")
    url = f"{base}/all.{form}"
    interrupted(url, added("a.obj"), added("x.obj", "deadline"))
    with pytest.raises(NotWritten, match="--resume"):
        Output(url, resume=False)
    with begun(url) as output:
        assert "0" * 64 in output.done_as("a.obj")
        assert not output.done_as("x.obj")
        output.add(*added("x.obj"))
        output._journal.close()
        assert [line["file"] for line in lines(f"{url}.journal/00000001.jsonl")] == ["x.obj"]
    fs, inner = fsspec.url_to_fs(f"{url}.journal")
    assert not fs.exists(inner)
    written = content(url)
    if form == "parquet":
        names = pyarrow.parquet.read_table(io.BytesIO(written)).column("file").to_pylist()
    elif form == "csv":
        names = [line.split(b",")[0].decode() for line in written.splitlines()[1:]]
    else:
        names = [json.loads(line)["file"] for line in written.splitlines()]
    assert names == ["a.obj", "x.obj"]


def test_what_another_attempt_may_change_is_done_again(tmp_path: Path) -> None:
    path = tmp_path / "all.jsonl"
    passing = [added("a.obj", "deadline"), added("b.obj", "unreadable", sha256=None)]
    write(path, *passing, added("c.obj", "no-faces"))
    with begun(path) as output:
        assert (output.tally.files, output.tally.reasons()) == (1, "no-faces 1")
        assert "0" * 64 in output.done_as("c.obj")
    assert [line["file"] for line in lines(path)] == ["c.obj"]


@pytest.mark.parametrize("url", ["{folder}/all.jsonl", "memory://{folder}/all.jsonl"])
def test_a_record_that_is_there_twice_is_kept_once(tmp_path: Path, url: str) -> None:
    path = url.format(folder=tmp_path)
    interrupted(path, added("a.obj"), added("a.obj"), added("b.obj"))
    with begun(path) as output:
        assert (output.tally.files, output.tally.earlier) == (2, 2)
        assert ["0" * 64 in output.done_as("a.obj") for _ in range(2)] == [True, False]
    assert [line["file"] for line in lines(path)] == ["a.obj", "b.obj"]


def test_no_folder_is_made_for_an_output(tmp_path: Path) -> None:
    with pytest.raises(NotWritten, match=f"there is no folder {tmp_path}/none; make it first"):
        Output(f"{tmp_path}/none/all.csv", resume=False)
    assert os.listdir(tmp_path) == []


def test_a_file_that_changed_is_done_with_its_last_content(tmp_path: Path) -> None:
    path = tmp_path / "all.jsonl"
    write(path, added("a.obj"), added("a.obj", sha256="1" * 64))
    with begun(path) as output:
        assert set(output.done_as("a.obj")) == {"0" * 64, "1" * 64}


def line_with(**changes: object) -> bytes:
    whole = json.loads(entry(answer("a.obj"), "0" * 64, RUN).model_dump_json(by_alias=True))
    return json.dumps(whole | changes).encode() + b"\n"


GOOD = line_with()


@pytest.mark.parametrize(
    ("damaged", "reason"),
    [
        (line_with(run="other"), "another model, or with another --top"),
        (b'{"my": "data"}\n', "line 1 is no record of this command"),
        (b"my data", "line 1 is no record"),
        (b"[1]\n", "line 1 is no record"),
        (GOOD + b"1\n", "line 2 is no record"),
        (GOOD + b"null\n", "line 2 is no record"),
        (GOOD + GOOD[:90] + b"\n" + GOOD, "line 2 is no record"),
        (GOOD + b"\0" * 50 + b"\n" + GOOD, "line 2 is no record"),
        (GOOD + b"\xff\xfe\x80" * 9 + b"\n", "line 2 is no record"),
        (GOOD + b'{"file":"' + b"\0" * 9 + b"\xff\n", "line 2 is no record"),
        (GOOD.decode().encode("utf-16"), "line 1 is no record"),
        (line_with(file=None), "line 1 is no record"),
        (line_with(file={"a": 1}), "line 1 is no record"),
        (line_with(mesh=None), "line 1 is no record"),
        (line_with(mesh={"faces_in": 1}), "line 1 is no record"),
        (line_with(scores="none"), "line 1 is no record"),
        (line_with(sha256=12), "line 1 is no record"),
        (line_with(sha256=None), "line 1 is no record"),
        (line_with(run=None), "line 1 is no record"),
        (line_with(file="\ud800"), "line 1 is no record"),
        (b"[" * 100_000 + b"\n", "line 1 is no record"),
        (b'{"file":"' + b"a" * LONGEST_LINE, "line 1 is no record"),
    ],
    ids=range(22),
)
def test_what_others_wrote_or_damaged_is_left_alone(
    tmp_path: Path, damaged: bytes, reason: str
) -> None:
    for name in ("all.jsonl", "all.csv.journal"):
        path = tmp_path / name
        path.write_bytes(damaged)
        with pytest.raises(NotWritten, match=reason):
            begun(str(path).removesuffix(".journal"))
        assert path.read_bytes() == damaged
        assert os.listdir(tmp_path) == [name]
        path.unlink()


@pytest.mark.parametrize("harmless", [b"", b"\n\n", bytes(5000), GOOD.replace(b"\n", b"\r\n")])
def test_what_is_empty_or_has_other_line_ends_is_gone_on_with(
    tmp_path: Path, harmless: bytes
) -> None:
    path = tmp_path / "all.csv"
    (tmp_path / "all.csv.journal").write_bytes(harmless)
    write(path, added("b.obj"))
    with path.open(newline="") as file:
        names = [row["file"] for row in csv.DictReader(file)]
    assert names == ["a.obj"] * harmless.startswith(b"{") + ["b.obj"]


@pytest.mark.parametrize("name", ["all.jsonl", "all.csv.journal"])
def test_a_journal_that_is_no_file_of_ours(tmp_path: Path, name: str) -> None:
    """A folder, a pipe, a device by a link, and somebody's file by a link."""
    path, theirs = tmp_path / name, tmp_path / "theirs"
    theirs.write_text("theirs")
    for make in (
        path.mkdir,
        lambda: os.mkfifo(path),
        *(lambda to=to: path.symlink_to(to) for to in ("/dev/full", "theirs", "nowhere")),
    ):
        make()
        with pytest.raises(OSError, match=r"directory|no file|it is a link"):
            begun(str(path).removesuffix(".journal"))
        path.rmdir() if path.is_dir() else path.unlink()
    assert theirs.read_text() == "theirs"
    assert os.listdir(tmp_path) == ["theirs"]


@pytest.mark.parametrize("form", ["jsonl", "csv", "parquet"])
def test_nothing_is_written_through_a_link(tmp_path: Path, form: str) -> None:
    """Nor where it is put there as the work goes on."""
    path, theirs = tmp_path / f"all.{form}", tmp_path / "theirs"
    theirs.write_text("theirs")
    path.symlink_to(theirs)
    with pytest.raises(NotWritten, match="is there already"):
        Output(str(path), resume=False)
    path.unlink()
    if form != "jsonl":
        with begun(path) as output:
            output.add(*added("a.obj"))
            path.symlink_to(theirs)
        assert not path.is_symlink()
    assert theirs.read_text() == "theirs"


@pytest.mark.parametrize("resume", [False, True])
def test_a_table_without_its_journal_is_left_alone(tmp_path: Path, resume: bool) -> None:
    (tmp_path / "all.csv").write_text("mine")
    with pytest.raises(NotWritten, match="name another file"):
        Output(str(tmp_path / "all.csv"), resume)


@pytest.mark.parametrize("path", ["all.txt", "all", "all.json", "s3://bucket/all"])
def test_forms_that_are_not_written(path: str) -> None:
    with pytest.raises(NotWritten, match=r"\.jsonl, \.csv, \.parquet"):
        Output(path, resume=False)


def test_two_do_not_write_the_same(tmp_path: Path) -> None:
    path = tmp_path / "all.jsonl"
    with begun(path) as first:
        first.add(*added("a.obj"))
        with pytest.raises(OSError, match="another process writes"):
            begun(path)


def test_a_run_is_told_apart_by_all_that_changes_a_record() -> None:
    runs = {
        run_id(model, top, limits)
        for model in ("1" * 64, "2" * 64)
        for top in (None, 3)
        for limits in (Limits(), Limits(faces=10))
    }
    assert len(runs) == 8


@pytest.mark.parametrize("form", ["jsonl", "csv"])
def test_a_full_disk_is_told_with_the_file_and_gone_on_with(tmp_path: Path, form: str) -> None:
    path = tmp_path / f"all.{form}"
    _, most = resource.getrlimit(resource.RLIMIT_FSIZE)
    records = [added(f"{number}.obj") for number in range(9)]

    def fill() -> None:
        with begun(path) as output:
            resource.setrlimit(resource.RLIMIT_FSIZE, (3000, most))
            for one in records:
                output.add(*one)

    try:
        with pytest.raises(OSError, match="File too large") as told:
            fill()
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, (most, most))
    assert str(told.value.filename) == Output(str(path), resume=True).journal_path
    with begun(path) as output:
        done = [bool(output.done_as(record.file or "")) for record, _ in records]
        assert done == sorted(done, reverse=True)
        assert any(done)
        for one in records[sum(done) :]:
            output.add(*one)
    assert len(path.read_bytes().splitlines()) == 9 + (form == "csv")


def written(form: str, *records: Added) -> bytes:
    file = io.BytesIO()
    FORMS[form]([entry(record, sha256, "1") for record, sha256 in records], file)
    return file.getvalue()


def test_all_of_an_explained_record_is_in_every_form(model_file: Path) -> None:
    """Which has a stage more than others."""
    explained = explain(Classifier.load(str(model_file)), sample_paths()["lamp"])
    record = record_of("lamp.obj", explained.prediction)
    whole = record.model_dump(by_alias=True, mode="json") | {"sha256": "0" * 64, "run": "1"}
    assert json.loads(written("jsonl", (record, "0" * 64))) == whole
    table = pyarrow.parquet.read_table(io.BytesIO(written("parquet", (record, "0" * 64))))
    assert table.to_pylist() == [whole | {"error": None}]
    (row,) = csv.DictReader(io.StringIO(written("csv", (record, "0" * 64)).decode()))
    empty = {name for name, value in row.items() if not value}
    assert empty == {"error.fault", "error.message", "mesh.note"}
    assert json.loads(row["scores"]) == whole["scores"]


def test_booleans_and_numbers_in_csv_are_those_of_json() -> None:
    record = answer("a.obj", unknown=True).model_copy(update={"novelty": -3.5})
    (row,) = csv.DictReader(io.StringIO(written("csv", (record, "0" * 64)).decode()))
    truths = {name: value for name, value in row.items() if value.lower() in ("true", "false")}
    assert set(truths.values()) == {"true"}
    assert set(truths) == {"unknown", "mesh.watertight", "mesh.within_budget"}
    assert (row["novelty"], row["mesh.faces_in"]) == ("-3.5", "1200")


@pytest.mark.parametrize("start", ["=", "+", "-", "@", "\t", "\r", "\n"])
def test_no_cell_of_csv_is_a_formula(start: str) -> None:
    name = f"{start}cmd|' /C calc'!A0.obj"
    records = [
        (answer(name, label=name), "0" * 64),
        (refusal(name, "no-faces", message=name), "0" * 64),
        (answer(f"a{name}", label=f"'{name}"), "0" * 64),
    ]
    rows = list(csv.DictReader(io.StringIO(written("csv", *records).decode(), newline="")))
    assert [row["file"] for row in rows] == [f"'{name}", f"'{name}", f"a{name}"]
    assert [row["class"] for row in rows] == [f"'{name}", "", f"'{name}"]
    assert rows[1]["error.message"] == f"'{name}"
    assert not any(cell.startswith(start) for row in rows for cell in row.values())
