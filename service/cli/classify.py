"""`meshconv3d classify`: files and folders in, a record for each file out."""

import sys
from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import click

from service.cli.explain import explain_all
from service.cli.shared import STDIN, load_classifier
from service.cli.terminal import readable, shown, with_progress

if TYPE_CHECKING:
    from model.errors import MeshError
    from service.classifier import Classification
    from service.records import Answer, Refusal

# The class and its runner-up: with more, the table outgrows a terminal of 80 columns.
TABLE_TOP = 2


@click.command()
@click.argument("paths", nargs=-1, required=True, metavar="PATH...")
@click.option("--model", help="Shipped model by name, or a model file. [default: shrec11]")
@click.option("--top", type=click.IntRange(1), help="Only the N likeliest classes of each.")
@click.option("--json", "as_json", is_flag=True, help="JSON Lines, as when the output is piped.")
@click.option("--format", "declared", help="Format of the mesh on standard input, such as stl.")
@click.option(
    "--explain",
    "out",
    type=click.Path(path_type=Path),
    metavar="OUT",
    help="Write the mesh coloured by what each face says for its class: to OUT.glb or .ply, as "
    "numbers to OUT.json, or as a GLB of each mesh into the folder OUT.",
)
@click.option("--class", "label", metavar="NAME", help="Explain this class, not the likeliest.")
@click.pass_context
def classify(
    ctx: click.Context,
    paths: tuple[str, ...],
    model: str | None,
    top: int | None,
    as_json: bool,
    declared: str | None,
    out: Path | None,
    label: str | None,
) -> None:
    """Say what the meshes in files and folders are; - reads one mesh from standard input.

    Folders are searched recursively. Prints a table at a terminal and JSON Lines otherwise, in
    the order of the input. A file that cannot be used is a record with its reason. Exits with 0
    if every file was classified, 1 if some were not, 2 if the call itself is wrong.
    """
    from model.loading import FORMATS

    files = list(_expand(paths))
    if declared and declared.lower() not in FORMATS:
        raise click.UsageError(f"unknown --format {declared!r}: choose from {', '.join(FORMATS)}")
    if declared and STDIN not in files:
        raise click.UsageError("--format is for standard input, which no PATH names: add -")
    if files.count(STDIN) > 1:
        raise click.UsageError("- stands for standard input, which holds one mesh: name it once")
    if label is not None and out is None:
        raise click.UsageError("--class says what to explain: add --explain OUT")
    classifier = load_classifier(model)
    sources = ((sys.stdin.buffer.read(), declared) if file == STDIN else file for file in files)
    if out is None:
        results = classifier.classify_many(sources)
    else:
        results = explain_all(classifier, files, sources, out, label)
    if as_json or not sys.stdout.isatty():
        failures = _print_lines(_records(files, results, top))
    else:
        records = _records(files, results, top or TABLE_TOP)
        failures = _print_table(with_progress(records, len(files)))
    ctx.exit(1 if failures else 0)


def _expand(paths: Iterable[str]) -> Iterator[str]:
    """The files to classify, in order. A file that was named is tried whatever its name."""
    from model.loading import FORMATS, find_meshes

    for text in paths:
        path = Path(text)
        if path.is_dir():
            found = find_meshes(path)
            if not found:
                raise click.UsageError(
                    f"no mesh files under {text} (read are: {', '.join(FORMATS)})"
                )
            yield from map(str, found)
        elif text == STDIN or path.exists():
            yield text
        else:
            raise click.UsageError(f"no such file or folder: {text}")


def _records(
    files: Sequence[str],
    results: "Iterable[Classification | MeshError | OSError]",
    top: int | None,
) -> "Iterator[Answer | Refusal]":
    from service.classifier import Classification
    from service.records import answer, refusal

    for file, result in zip(files, results, strict=True):
        if isinstance(result, Classification):
            yield answer(readable(file), result, top)
        else:
            yield refusal(readable(file), result)


def _print_lines(records: "Iterable[Answer | Refusal]") -> int:
    """Print JSON Lines as they come; returns the number of refusals."""
    from service.records import Refusal

    failures = 0
    for record in records:
        click.echo(record.model_dump_json(by_alias=True))
        failures += isinstance(record, Refusal)
    return failures


def _print_table(records: "Iterable[Answer | Refusal]") -> int:
    """Print a table for people; returns the number of refusals."""
    from rich.console import Console
    from rich.table import Table

    from service.records import Refusal

    table = Table(box=None, pad_edge=False)
    table.add_column("File", overflow="fold")
    table.add_column("Class")
    table.add_column("Probability", justify="right")
    table.add_column("Next")
    table.add_column("Faces", no_wrap=True)
    refused: list[Refusal] = []
    for record in records:
        name = shown(record.file or "")
        if isinstance(record, Refusal):
            refused.append(record)
            table.add_row(name, f"[red]{shown(record.error.fault)}[/red]")
            continue
        faces = _faces(record.mesh.faces_in, record.mesh.faces_used)
        if record.unknown:
            nearest = f"nearest {shown(record.class_)}"
            table.add_row(name, "[yellow]unknown[/yellow]", "", nearest, faces)
            continue
        table.add_row(
            name,
            f"[bold]{shown(record.class_)}[/bold]",
            f"{record.probability:.1%}",
            ", ".join(
                f"{shown(score.class_)} {score.probability:.1%}" for score in record.scores[1:]
            ),
            faces,
        )
    console = Console(highlight=False)
    console.print(table)
    for record in refused:  # below: a sentence in a column would squeeze all others
        line = f"{shown(record.file or '')}: {shown(record.error.message)}"
        console.print(f"[red]{line}[/red]", soft_wrap=True)
    return len(refused)


def _faces(faces_in: int, faces_used: int) -> str:
    return f"{faces_in}" if faces_in == faces_used else f"{faces_in} → {faces_used}"
