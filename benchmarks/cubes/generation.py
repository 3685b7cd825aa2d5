"""Generation of the data set: split the silhouettes, engrave, resume."""

import json
import multiprocessing
import signal
from collections.abc import Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from dataclasses import asdict, dataclass
from pathlib import Path

import numpy as np
import trimesh

from benchmarks.cubes.engraving import MOST_CORNERS, engraved_cube
from benchmarks.cubes.recipe import CubesError, Recipe
from benchmarks.cubes.silhouettes import Silhouette, find_silhouettes, outline
from meshconv3d.model.datasets import Sample, write_split
from meshconv3d.model.files import write_whole
from meshconv3d.model.mesh import Mesh

RECORD_FILE = "cubes.json"
HELD_OUT_FILE = "held_out.csv"
HELD_OUT = 2  # of a class's silhouettes to train on


@dataclass(frozen=True)
class Task:
    """The cubes of one silhouette.

    seed: the run's, the class's index and the silhouette's number; a cube adds its own.
    held_out: one to train on, but to validate on for those who hold some out.
    """

    silhouette: Silhouette
    folder: Path
    copies: int
    seed: tuple[int, int, int]
    held_out: bool

    def path(self, copy: int) -> Path:
        return self.folder / f"{self.silhouette.name}-{copy:02d}.ply"


def plan(silhouettes: Path, out: Path, recipe: Recipe, seed: int) -> list[Task]:
    """All tasks for `out`, one for a silhouette, complete ones included.

    The seed decides which silhouettes are for testing. Raises CubesError where silhouettes are
    missing.
    """
    found = find_silhouettes(silhouettes, recipe.classes, recipe.silhouettes)
    tasks = []
    for index, (label, members) in enumerate(found.items()):
        # No cube draws the same numbers: silhouettes are counted from 1.
        order = np.random.default_rng([seed, index]).permutation(len(members))
        for place, member in enumerate(order):
            split = "train" if place < recipe.train else "test"
            one = members[member]
            key = (seed, index, one.number)
            held_out = recipe.train - HELD_OUT <= place < recipe.train
            tasks.append(Task(one, out / label / split, recipe.copies, key, held_out))
    return tasks


def claim(out: Path, recipe: Recipe, seed: int) -> None:
    """Create the folder with a record of what is made there.

    Raises CubesError where the folder holds anything else: cubes of two seeds together would
    have silhouettes on both sides of the split.
    """
    record = json.dumps({"engraved cubes": asdict(recipe), "seed": seed}, indent=2) + "\n"
    file = out / RECORD_FILE
    out.mkdir(parents=True, exist_ok=True)
    if file.is_file():
        if file.read_bytes() != record.encode():
            raise CubesError(f"{out} holds cubes of another seed or recipe (see {file})")
    elif any(out.iterdir()):
        raise CubesError(f"{out} holds something else: name a new folder, or an empty one")
    else:
        write_whole(file, record.encode())


def write_held_out(tasks: Sequence[Task], out: Path) -> None:
    """Write the split with `val` as a table: whole silhouettes, as for testing.

    Holding random cubes out would validate on outlines that were trained on.
    """
    samples = [
        Sample(task.path(copy), task.silhouette.label, "val" if task.held_out else task.folder.name)
        for task in tasks
        for copy in range(task.copies)
    ]
    write_split(sorted(samples, key=lambda sample: str(sample.path)), out / HELD_OUT_FILE)


def generate(tasks: Sequence[Task], workers: int) -> Iterator[int]:
    """Run the tasks in so many processes, one alone in this one.

    Yields for every finished task how many cubes it wrote; those that were there are skipped. The
    order of the tasks and the number of workers change no cube. Raises CubesError naming the
    silhouette; what is finished stays.
    """
    if workers == 1:
        yield from map(run, tasks)
        return
    # Spawned: a fork would copy this process with whatever threads it runs by then.
    context = multiprocessing.get_context("spawn")
    with ProcessPoolExecutor(workers, context, _leave_interrupts) as pool:
        try:
            for done in as_completed([pool.submit(run, task) for task in tasks]):
                yield done.result()
        finally:
            pool.shutdown(cancel_futures=True)


def run(task: Task) -> int:
    """Write the cubes of a task that are missing; returns how many."""
    missing = [copy for copy in range(task.copies) if not task.path(copy).exists()]
    if not missing:
        return 0
    shape = outline(task.silhouette.path, MOST_CORNERS)
    task.folder.mkdir(parents=True, exist_ok=True)
    for copy in missing:
        rng = np.random.default_rng([*task.seed, copy])
        try:
            cube = engraved_cube(shape, rng)
        except CubesError as error:
            raise CubesError(f"{task.silhouette.path}, copy {copy}: {error}") from None
        write_whole(task.path(copy), _as_ply(cube))
    return len(missing)


def _as_ply(mesh: Mesh) -> bytes:
    """Binary PLY, coordinates in single precision."""
    content = trimesh.Trimesh(mesh.vertices, mesh.faces, process=False).export(file_type="ply")
    assert isinstance(content, bytes)
    return content


def _leave_interrupts() -> None:
    """Ignore Ctrl-C, which goes to all processes: the parent ends its workers."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
