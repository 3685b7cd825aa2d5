"""`meshconv3d teach`: a model of a user's own classes, from a few examples of each."""

from pathlib import Path
from typing import TYPE_CHECKING

import click

from meshconv3d.service.cli.setup import read_settings, usage_errors
from meshconv3d.service.cli.terminal import printable
from meshconv3d.service.records import readable

if TYPE_CHECKING:
    from meshconv3d.export.metadata import ModelCard
    from meshconv3d.export.teaching import Examples, LeftOut, Teacher
    from meshconv3d.model.loading import Limits
    from meshconv3d.model.mesh import Mesh

# What a mesh of no class is called, in tables and as a folder.
UNKNOWN = "unknown"
# Lines of each kind that are printed.
NAMED = 10


@click.command()
@click.argument(
    "folder", metavar="EXAMPLES", type=click.Path(exists=True, file_okay=False, path_type=Path)
)
@click.option(
    "-o",
    "--output",
    type=click.Path(dir_okay=False, path_type=Path),
    required=True,
    metavar="FILE.onnx",
    help="The model file to write.",
)
@click.option(
    "--base",
    metavar="MODEL",
    help="The model whose features are used, a shipped one or a file. [default: objects]",
)
@click.option(
    "--add",
    "taught",
    type=click.Path(exists=True, dir_okay=False, path_type=Path),
    metavar="FILE.onnx",
    help="Teach a taught model more: EXAMPLES are added to those it was taught with.",
)
@click.option("--name", help="The model's name. [default: that of the file]")
@click.option("--by", metavar="NAME", help="Whom the model's card names as its teacher.")
def teach(
    folder: Path,
    output: Path,
    base: str | None,
    taught: Path | None,
    name: str | None,
    by: str | None,
) -> None:
    """Make a model of your own classes from EXAMPLES/CLASS/files, in seconds.

    One mesh of a class is enough, five are good, a thousand are fine. Each example is tested on
    what the others say; examples that look mislabelled are named. Files in folders that are called
    test are no examples. The result is an ordinary model file: use it as --model FILE.onnx.
    """
    from meshconv3d.export.metadata import ModelFileError
    from meshconv3d.export.teaching import Teacher
    from meshconv3d.model.files import write_whole
    from meshconv3d.service.models import DEFAULT_MODEL, ModelFile

    if base and taught:
        raise click.UsageError("--add goes on with the base of its model: leave --base out")
    if not output.parent.is_dir():
        raise click.UsageError(f"--output {output}: there is no folder {output.parent}")
    if output.suffix.lower() != ".onnx":
        raise click.UsageError(f"--output {output} does not end with .onnx")
    settings = read_settings({})
    source = str(taught or base or DEFAULT_MODEL)
    with usage_errors(ModelFileError):
        content = ModelFile.read(source).content
        try:
            teacher = Teacher(content)
        except ModelFileError as error:
            raise click.UsageError(f"{source}: {error}") from None
        earlier = teacher.examples
        if taught and earlier is None:
            raise click.UsageError(f"--add {taught} was not made by teach: give it as --base")
        examples = _read(teacher, folder, settings.limits)
        if earlier is not None and examples.files:
            examples = earlier.joined(examples)
        elif earlier is not None:
            raise click.UsageError(f"{folder} has no example to add, as {folder}/CLASS/FILE")
        examples, copies = examples.distinct()
        if len(examples.classes) < 2:
            found = ", ".join(examples.classes) or "none"
            raise click.UsageError(
                f"two classes or more are needed, as {folder}/CLASS/FILE with a mesh that can be "
                f"used; found {found}"
            )
        made = teacher.teach(name or output.stem, examples, _probe(), by)
    write_whole(output, made.content)
    _list("one mesh, several times in a class, taken once:", [", ".join(g) for g in copies])
    _report(examples, made.card, made.left_out)
    click.echo(f"wrote {output} ({len(made.content) / 1e6:.2f} MB)")


def _probe() -> "tuple[str, Mesh]":
    """A sample mesh for the self test of the model."""
    from meshconv3d.model.loading import load_mesh
    from meshconv3d.model.samples import sample_paths

    name, path = next(iter(sample_paths().items()))
    return name, load_mesh(path)


def _read(teacher: "Teacher", folder: Path, limits: "Limits") -> "Examples":
    """The examples in a folder; files that cannot be used are named and left out."""
    from rich.console import Console
    from rich.progress import track

    from meshconv3d.export.teaching import Examples
    from meshconv3d.model.datasets import DatasetError, list_samples
    from meshconv3d.model.errors import MeshError
    from meshconv3d.model.loading import load_mesh
    from meshconv3d.service.prediction import Failure

    with usage_errors(DatasetError):
        listed = list_samples(folder, undivided="train")
    samples = [sample for sample in listed if sample.split != "test"]
    reserved = [sample for sample in samples if sample.label == UNKNOWN]
    if reserved:
        raise click.UsageError(
            f"no class may be called {UNKNOWN}: that is what a mesh of no class is called; rename "
            f"the folder of {readable(str(reserved[0].path))}"
        )
    console = Console(stderr=True)
    used, features = [], []
    for sample in track(
        samples, "Reading", console=console, transient=True, disable=not console.is_terminal
    ):
        try:
            features.append(teacher.features(load_mesh(sample.path, limits=limits)))
            used.append(sample)
        except (MeshError, OSError) as error:
            reason = Failure.of(error).message
            click.echo(f"{readable(str(sample.path))} is left out: {printable(reason)}", err=True)
    folders = {p.name for p in folder.iterdir() if p.is_dir() and not p.name.startswith(".")}
    split_folders = {sample.split for sample in listed}
    if lacking := sorted(folders - {sample.label for sample in used} - split_folders):
        shown = ", ".join(map(printable, lacking[:NAMED]))
        click.echo(f"no example can be used of: {shown}", err=True)
    return Examples.of(
        [sample.label for sample in used],
        [readable(str(sample.path.relative_to(folder))) for sample in used],
        features,
    )


def _report(examples: "Examples", card: "ModelCard", left_out: "LeftOut") -> None:
    """Print what the examples say of one another."""
    from meshconv3d.export.teaching import (
        ENOUGH,
        LEAST_CALIBRATED,
        confusions,
        doubted,
        in_several_classes,
    )

    if len(left_out.labels):
        click.echo(
            f"{left_out.accuracy:.1%} of {len(left_out.labels)} examples, each left out in turn, "
            f"are classified rightly by the others ({len(examples.classes)} classes)"
        )
    _list(
        "taken for another class:",
        [f"{right} for {given}: {count}" for right, given, count in confusions(examples, left_out)],
    )
    if card.calibration is None:
        click.echo(
            f"too few examples to calibrate ({len(left_out.labels)} in classes of two or more, "
            f"{LEAST_CALIBRATED} are needed): probabilities are rough, and nothing is unknown"
        )
    else:
        _list(
            "look mislabelled; check them:",
            [
                f"{file}: the other examples say {given}"
                for file, given in doubted(examples, left_out, card.calibration.temperature)
            ],
        )
    _list("one mesh, in several classes:", [", ".join(g) for g in in_several_classes(examples)])
    counts = zip(examples.classes, examples.counts.tolist(), strict=True)
    _list(
        f"classes with fewer than {ENOUGH} examples, which more would help:",
        [f"{name}: {count}" for name, count in counts if count < ENOUGH],
    )


def _list(title: str, lines: list[str]) -> None:
    """Print a title and the first lines below it, if there are any."""
    if lines:
        click.echo(title)
    for line in lines[:NAMED]:
        click.echo(f"  {printable(line)}")
    if len(lines) > NAMED:
        click.echo(f"  and {len(lines) - NAMED} more")
