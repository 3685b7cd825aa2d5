"""`python -m benchmarks.cubes`: regenerate MeshCNN's engraved cubes."""

import os
from pathlib import Path

import click

EXISTING_FOLDER = click.Path(exists=True, file_okay=False, path_type=Path)


@click.command()
@click.argument("silhouettes", type=EXISTING_FOLDER)
@click.argument("out", type=click.Path(file_okay=False, path_type=Path))
@click.option("--seed", type=click.IntRange(0, 2**32 - 1), default=0, show_default=True)
@click.option("--workers", type=click.IntRange(1), help="Processes. [default: all cores]")
def cubes(silhouettes: Path, out: Path, seed: int, workers: int | None) -> None:
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
    from benchmarks.cubes.recipe import RECIPE, CubesError

    try:
        tasks = plan(silhouettes, out, RECIPE, seed)
        claim(out, RECIPE, seed)
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


if __name__ == "__main__":
    cubes(prog_name="python -m benchmarks.cubes")
