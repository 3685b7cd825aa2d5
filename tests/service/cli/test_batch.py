"""`meshconv3d batch`: outputs, what kills it, how it goes on."""

import json
import os
import random
import signal
import subprocess
import time
from collections import Counter
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from tests.commands import interruptible, meshconv3d, program
from tests.processes import family, until

FILES = 200


@pytest.fixture(scope="module")
def many(tmp_path_factory: pytest.TempPathFactory, meshes: Path) -> Path:
    """A folder of many files: rings, each with its own content, and some without faces."""
    folder = tmp_path_factory.mktemp("many")
    ring = (meshes / "ring.obj").read_bytes()
    for number in range(FILES):
        place = folder / str(number % 7)
        place.mkdir(exist_ok=True)
        content = ring if number % 10 else b"v 0 0 0\n"
        (place / f"{number}.obj").write_bytes(content + b"# %d\n" % number)
    return folder


def timeless(path: Path) -> list[dict]:
    return [json.loads(line) | {"timings_ms": None} for line in path.read_text().splitlines()]


@pytest.fixture(scope="module")
def uninterrupted(many: Path, model_file: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The output of a run that nothing disturbed, in the order of the files."""
    output = tmp_path_factory.mktemp("whole") / "all.jsonl"
    done = program("batch", many, "--model", model_file, "--output", output)
    assert (done.returncode, done.stdout) == (1, "")
    assert f"{FILES} files: 180 classified, 20 refused (no-faces 20); " in done.stderr
    return output


Begin = Callable[..., subprocess.Popen[str]]


@pytest.fixture
def begin(many: Path, model_file: Path) -> Iterator[Begin]:
    """Begins a run over the many files; ends what is left of it."""
    processes: list[subprocess.Popen[str]] = []

    def begin_one(*options: object) -> subprocess.Popen[str]:
        process = interruptible(*("batch", many, "--model", model_file, "--workers", "1", *options))
        processes.append(process)
        return process

    yield begin_one
    for process in processes:
        if process.poll() is None:
            process.kill()
            process.wait()


def test_a_run_that_finds_all_done_tells_no_rate(
    many: Path, model_file: Path, uninterrupted: Path
) -> None:
    before = uninterrupted.read_bytes()
    done = meshconv3d(
        *("batch", many, "--model", model_file, "--output", uninterrupted, "--resume")
    )
    assert (done.returncode, done.stdout) == (1, "")
    assert done.stderr.endswith(f"20 refused (no-faces 20), {FILES} of them earlier\n")
    assert uninterrupted.read_bytes() == before


def test_the_order_is_that_of_the_folder(uninterrupted: Path, many: Path) -> None:
    expected = [str(path) for path in sorted(many.rglob("*.obj"))]
    assert [record["file"] for record in timeless(uninterrupted)] == expected


def test_killed_again_and_again_it_ends_as_if_never_killed(
    begin: Begin, uninterrupted: Path, tmp_path: Path
) -> None:
    """At any moment, of which some are in the middle of a line: no file twice, none missing."""
    output = tmp_path / "all.jsonl"
    chance = random.Random("jsonl")
    size = uninterrupted.stat().st_size
    for _ in range(2):
        before = output.stat().st_size if output.exists() else 0
        enough = before + chance.random() * size / 4
        run = begin("--output", output, "--resume")
        until(lambda enough=enough: output.exists() and output.stat().st_size > enough, 60)
        time.sleep(chance.random() / 50)
        assert run.poll() is None
        workers = family(run.pid)
        run.kill()
        run.wait()
        until(lambda workers=workers: not any(os.path.exists(f"/proc/{w}") for w in workers), 60)
        with output.open("ab") as file:
            file.write(b'{"file":"torn'[: chance.randrange(13)])
    run = begin("--output", output, "--resume")
    _, told = run.communicate(timeout=120)
    assert run.returncode == 1
    assert f"{FILES} files: 180 classified, 20 refused (no-faces 20), " in told
    assert timeless(output) == timeless(uninterrupted)


def test_an_interrupt_says_how_to_go_on(begin: Begin, tmp_path: Path) -> None:
    """It reaches all processes, as from a terminal; none of them has more to say."""
    output = tmp_path / "all.csv"
    journal = tmp_path / "all.csv.journal"
    run = begin("--output", output)
    until(lambda: journal.exists() and journal.stat().st_size > 20_000, 60)
    os.killpg(run.pid, signal.SIGINT)
    printed, told = run.communicate(timeout=60)
    assert (run.returncode, printed) == (130, "")
    assert [line for line in told.splitlines() if line] == [
        f"{journal} has what is done: go on with it by --resume",
        "interrupted",
    ]


def test_shards_are_the_whole(
    many: Path, model_file: Path, uninterrupted: Path, tmp_path: Path
) -> None:
    records = []
    for shard in ("1/2", "2/2"):
        output = tmp_path / f"{shard[0]}.jsonl"
        meshconv3d(
            *("batch", many, "--model", model_file, "--workers", 1),
            *("--output", output, "--shard", shard),
        )
        records += timeless(output)
    whole = timeless(uninterrupted)
    assert Counter(map(json.dumps, records)) == Counter(map(json.dumps, whole))


def test_patterns_and_files_of_other_formats(many: Path, model_file: Path, tmp_path: Path) -> None:
    output = tmp_path / "all.jsonl"
    others = [many / name for name in ("a.blend", "3/b.blend", "c.iges")]
    for other in others:
        other.touch()
    call = ("batch", many, "--model", model_file, "--include", "3/*", "--exclude", "*0.obj")
    done = meshconv3d(*call, "--output", output)
    for other in others:
        other.unlink()
    assert done.returncode == 0
    assert done.stderr.splitlines()[1:] == ["1 file of other formats: .blend 1"]
    files = [record["file"] for record in timeless(output)]
    assert files
    assert all("/3/" in file and not file.endswith("0.obj") for file in files)


def test_classify_with_an_output_is_batch(model_file: Path, meshes: Path, tmp_path: Path) -> None:
    """As scripts have it that are older than the command."""
    output = tmp_path / "all.csv"
    done = meshconv3d("classify", meshes / "ring.obj", "--model", model_file, f"--output={output}")
    assert done.returncode == 0
    assert "classify is now meshconv3d batch" in done.stderr
    assert len(output.read_text().splitlines()) == 2


@pytest.mark.parametrize(
    ("options", "reason"),
    [
        ([], "Missing option '-o'"),
        (["--output", "{folder}/there.jsonl"], "by --resume, or name another file"),
        (["--output", "{folder}/there.jsonl", "--resume"], "line 1 is no record of this command"),
        (["--output", "{folder}/there.csv", "--resume"], "name another file"),
        (["--output", "{folder}/all.txt"], "does not end with a form"),
        (["--output", "{folder}/none/all.csv"], "there is no folder"),
        (["-o", "{folder}/all.csv", "--shard", "3/2"], "no part of a whole"),
        (["-o", "{folder}/all.csv", "--include", "*.ply"], "that --include and --exclude let in"),
        (["-o", "{folder}/all.csv", "--workers", "0"], "--workers"),
        (["-o", "{folder}/all.csv", "-"], "standard input: meshconv3d classify -"),
    ],
)
def test_wrong_calls(
    meshes: Path, model_file: Path, tmp_path: Path, options: list[str], reason: str
) -> None:
    """Each is exit 2 with its reason, and nothing is written."""
    for name in ("there.jsonl", "there.csv"):
        (tmp_path / name).write_text("mine")
    options = [option.format(folder=tmp_path) for option in options]
    done = meshconv3d("batch", meshes, "--model", model_file, *options)
    assert (done.returncode, done.stdout) == (2, "")
    assert reason in " ".join(done.stderr.split())
    assert sorted(path.name for path in tmp_path.iterdir()) == ["there.csv", "there.jsonl"]
    assert (tmp_path / "there.jsonl").read_text() == "mine"
