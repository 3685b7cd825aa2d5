"""`meshconv3d data`: make a data set to train on."""

import os
from pathlib import Path

import click

EXISTING_FOLDER = click.Path(exists=True, file_okay=False, path_type=Path)


@click.group()
def data() -> None:
    """Make a data set to train on."""


@data.command()
@click.argument("silhouettes", type=EXISTING_FOLDER)
@click.argument("out", type=click.Path(file_okay=False, path_type=Path))
@click.option(
    "--others",
    is_flag=True,
    help="Cubes of the other 48 classes instead, 4800 and all to train on: for `train --from`.",
)
@click.option("--seed", type=click.IntRange(0, 2**32 - 1), default=0, show_default=True)
@click.option("--workers", type=click.IntRange(1), help="Processes. [default: all cores]")
def cubes(silhouettes: Path, out: Path, others: bool, seed: int, workers: int | None) -> None:
    """Regenerate MeshCNN's engraved cubes in OUT, as CLASS/{train,test}/*.ply.

    SILHOUETTES is the data set MPEG-7 CE-Shape-1 part B, unpacked: 1400 GIFs called Bone-1.gif to
    watch-20.gif, in one folder or in one for each class. Its home is
    http://www.dabi.temple.edu/~shape/MPEG7/dataset.html (MPEG7dataset.zip); elsewhere it is
    called MPEG7_CE-Shape-1_Part_B.zip. 22 of its 70 classes are used.

    There will be 3740 cubes to train on and 660 to test on, closed, of 500 faces each; no
    silhouette is on both sides. The table OUT/held_out.csv, for `meshconv3d train --split`, holds
    440 of those to train on out, by silhouette too. The same seed gives the same cubes. Run the
    same command again to go on after an interruption.
    """
    from rich.console import Console
    from rich.progress import track

    from benchmarks.cubes.generation import claim, generate, plan, write_held_out
    from benchmarks.cubes.recipe import OTHERS, RECIPE, CubesError

    recipe = OTHERS if others else RECIPE
    try:
        tasks = plan(silhouettes, out, recipe, seed)
        claim(out, recipe, seed)
        write_held_out(tasks, out)
    except CubesError as error:
        raise click.UsageError(str(error)) from None
    console = Console(stderr=True)
    done = generate(tasks, workers or os.cpu_count() or 1)
    try:
        written = sum(
            track(
                done,
                "Engraving",
                total=len(tasks),
                console=console,
                disable=not console.is_terminal,
            )
        )
    except CubesError as error:
        raise click.ClickException(str(error)) from None
    train, test = (
        sum(task.copies for task in tasks if task.folder.name == split)
        for split in ("train", "test")
    )
    there = f"{train} to train on and {test} to test on are in {out}"
    click.echo(f"wrote {written} cubes; {there}")


@data.command()
@click.argument("folder", type=EXISTING_FOLDER, metavar="DATA")
@click.argument("out", type=click.Path(dir_okay=False, path_type=Path), metavar="SPLIT.csv")
@click.option(
    "--train",
    type=click.IntRange(1),
    required=True,
    help="Meshes of each class to train on; the others are to test on.",
)
@click.option("--seed", type=click.IntRange(0, 2**32 - 1), default=0, show_default=True)
def split(folder: Path, out: Path, train: int, seed: int) -> None:
    """Split DATA at random, whatever split it comes in, and write that down in SPLIT.csv.

    For `meshconv3d train --split SPLIT.csv`. SHREC11's split 10 is --train 10, for a few seeds.
    """
    from meshconv3d.model.training.datasets import DatasetError, list_samples
    from meshconv3d.model.training.splits import random_split, write_split

    try:
        samples = random_split(list_samples(folder), train, 0, seed)
        if not samples:
            raise DatasetError(f"there are no meshes CLASS/*.obj, of whatever format, in {folder}")
        write_split(samples, out)
    except DatasetError as error:
        raise click.UsageError(str(error)) from None
    counts = [sum(sample.split == name for sample in samples) for name in ("train", "test")]
    click.echo(f"wrote {out}: {counts[0]} meshes to train on, {counts[1]} to test on")


if __name__ == "__main__":
    data()
