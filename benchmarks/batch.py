"""Throughput and memory of `meshconv3d batch`: `python -m benchmarks.batch`.

Two tables, over copies of the samples. Files per second of each engine, with the time that the
command itself and its workers compute for each file. And memory against the number of files: of
all processes, the highest that was seen, what they share counted once.
"""

import argparse
import os
import platform
import re
import subprocess
import sys
import tempfile
import time
from dataclasses import dataclass
from itertools import cycle, islice
from pathlib import Path

from benchmarks.processes import computed_by, family_of, memory_of
from tests.articulated import sample_paths

CORES = len(os.sched_getaffinity(0))
FOLDER_FILES = 1000
SAMPLE_SECONDS = 0.2
# The system goes through all pages of a process to tell its memory: seldom, not to be in the way.
MEMORY_SECONDS = 2.0


@dataclass(frozen=True)
class Way:
    """One way to run the command. options: what it is given beside the folder."""

    title: str
    options: tuple[str, ...]


WAYS = [
    Way("1 worker", ("--workers", "1")),
    Way(f"{CORES} workers", ("--workers", str(CORES))),
    Way(f"Ray, {CORES} workers", ("--workers", str(CORES), "--ray", "local")),
]


@dataclass(frozen=True)
class Run:
    """All but the start. rate: files per second. here, workers: seconds that the command and all
    that come from it computed; memory: MB."""

    rate: float
    here: float
    workers: float
    memory: float


def copies(folder: Path, count: int) -> None:
    """Fill a folder with links to copies of the samples, a thousand to each folder in it."""
    sources = []
    folder.mkdir()
    for path in sample_paths().values():
        sources.append(folder.parent / path.name)
        sources[-1].write_bytes(path.read_bytes())
    for number, source in enumerate(islice(cycle(sources), count)):
        place = folder / f"{number // FOLDER_FILES:04}"
        place.mkdir(exist_ok=True)
        os.link(source, place / f"{number:06}{source.suffix}")


def run(folder: Path, output: Path, way: Way) -> Run:
    """Classify a folder in a process of its own, and watch it."""
    program = str(Path(sys.executable).with_name("meshconv3d"))
    output.unlink(missing_ok=True)
    command = [program, "batch", str(folder), "--output", str(output), *way.options]
    process = subprocess.Popen(command, stderr=subprocess.PIPE, text=True)
    started: dict[int, float] = {}
    computed: dict[int, float] = {}
    memory, weighed = 0.0, -MEMORY_SECONDS
    while process.poll() is None:
        seconds = {member: computed_by(member) for member in family_of(process.pid)}
        if not output.exists():  # which is made once all workers are warm
            started = seconds
        for member, spent in seconds.items():
            since = spent - started.get(member, 0.0)
            computed[member] = max(computed.get(member, 0.0), since)
        if time.monotonic() > weighed + MEMORY_SECONDS:
            memory = max(memory, memory_of(process.pid))
            weighed = time.monotonic()
        time.sleep(SAMPLE_SECONDS)
    assert process.stderr is not None
    told = process.stderr.read()
    rate = re.search(r"([\d.]+) files/s", told)
    assert process.returncode == 0, told
    assert rate is not None, told
    here = computed.pop(process.pid)
    return Run(float(rate[1]), here, sum(computed.values()), memory)


def compare_ways(folder: Path, output: Path, count: int) -> None:
    """Print the rate of each way with as many files."""
    copies(folder, count)
    print(
        f"\n{count} files                    files/s   of the first   computed/file: command, rest"
    )
    first = None
    for way in WAYS:
        done = run(folder, output, way)
        first = first or done.rate
        here, rest = (seconds / count * 1000 for seconds in (done.here, done.workers))
        print(f"  {way.title:26}{done.rate:8.0f}{done.rate / first:14.2f}x", end="")
        print(f"{here:15.2f} ms{rest:9.2f} ms", flush=True)


def memory_against_files(place: Path, output: Path, counts: list[int]) -> None:
    """Print the memory of all processes for each number of files."""
    way = WAYS[1]
    print(f"\n{way.title}          files   memory of all processes   files/s")
    for count in counts:
        folder = place / f"memory-{count}"
        copies(folder, count)
        done = run(folder, output, way)
        print(f"{count:26}{done.memory:22.0f} MB{done.rate:10.0f}", flush=True)


def main() -> None:
    parser = argparse.ArgumentParser(description="What `meshconv3d batch` does over folders.")
    parser.add_argument("--files", type=int, default=5000, help="to compare engines with")
    parser.add_argument("--memory", type=int, nargs="*", default=[1000, 10_000, 100_000])
    arguments = parser.parse_args()
    print(f"{platform.machine()}, {CORES} cores, Python {platform.python_version()}; ", end="")
    print(f"load before: {os.getloadavg()[0]:.1f}")
    with tempfile.TemporaryDirectory() as temporary:
        place = Path(temporary)
        output = place / "results.jsonl"
        compare_ways(place / "engines", output, arguments.files)
        memory_against_files(place, output, arguments.memory)


if __name__ == "__main__":
    main()
