"""`meshconv3d embed`, `similar` and `duplicates`: libraries of meshes, and search in them."""

import json
import sys
from pathlib import Path
from typing import TYPE_CHECKING

import click

from meshconv3d.service.cli.setup import (
    list_files,
    load_classifier,
    model_option,
    pool_executor,
    read_settings,
    resume_option,
    usage_errors,
    workers_option,
)
from meshconv3d.service.cli.terminal import printable, shown

if TYPE_CHECKING:
    from meshconv3d.service.classifier import Classifier
    from meshconv3d.service.library import Library

LIBRARY = click.Path(exists=True, dir_okay=False, path_type=Path)
# Groups that are printed at a terminal.
SHOWN_GROUPS = 50


@click.command()
@click.argument("paths", nargs=-1, required=True, metavar="PATH...")
@click.option(
    "-o",
    "--output",
    "file",
    required=True,
    metavar="FILE.parquet",
    help="The library to write: a row for each mesh.",
)
@resume_option
@model_option
@workers_option
@click.pass_context
def embed(
    ctx: click.Context,
    paths: tuple[str, ...],
    file: str,
    resume: bool,
    model: str | None,
    workers: int | None,
) -> None:
    """Make a library of the meshes in files and folders, to search for alike ones.

    A PATH is what it is for batch. A row has the embedding of a mesh, its class and size, and a
    picture where the extra `report` is installed. After an interruption, the same call with
    --resume goes on.
    """
    from importlib.util import find_spec

    from meshconv3d.service.batch.outputs import Output
    from meshconv3d.service.batch.resume import NotWritten
    from meshconv3d.service.batch.running import FileResult, run_id
    from meshconv3d.service.cli.batch import write_output
    from meshconv3d.service.prediction import Failure
    from meshconv3d.service.records import embedded_answer, record

    listing = list_files(paths)
    with usage_errors(NotWritten, option="--output"):
        output = Output(file, resume, library=True)
    settings = read_settings({"workers": workers})
    model_id, executor = pool_executor(model, settings, pictured=find_spec("PIL") is not None)

    def add(one: FileResult) -> None:
        if isinstance(one.result, Failure):
            output.add(record(one.file.name, one.result), one.sha256)
        else:
            found = embedded_answer(one.file.name, one.result, top=1)
            output.add(found, one.sha256, one.picture)

    run = run_id(model_id.sha256, 1, settings.limits, embedded=True)
    write_output(output, run, executor, listing, add)
    ctx.exit(1 if output.tally.refused else 0)


@click.command()
@click.argument("file", metavar="FILE", type=click.Path(exists=True, dir_okay=False))
@click.option("--in", "library", type=LIBRARY, required=True, help="The library to search.")
@click.option("--top", type=click.IntRange(1), default=10, show_default=True, help="So many.")
@model_option
@click.option("--json", "as_json", is_flag=True, help="JSON Lines, as when the output is piped.")
def similar(file: str, library: Path, top: int, model: str | None, as_json: bool) -> None:
    """Find the meshes of a library that are most like the one in FILE.

    The search is exact. The distance is 0 for the same shape and at most 2; the probability that
    both are one shape, whatever their triangles, size and position, is calibrated.
    """
    from meshconv3d.model.errors import MeshError

    classifier, found = _open(library, model)
    try:
        prediction = classifier.classify(file)
    except MeshError as error:
        raise click.ClickException(f"{printable(file)}: {error}") from None
    matches = [
        {
            "file": found.value("file", row),
            "class": found.value("class", row),
            "unknown": found.value("unknown", row),
            "distance": round(distance, 5),
            "same_shape": share and round(share, 5),
        }
        for row, distance, share in found.nearest(prediction.embedding, top)
    ]
    if as_json or not sys.stdout.isatty():
        for match in matches:
            click.echo(json.dumps(match))
        return
    from rich.console import Console
    from rich.table import Table

    table = Table("file", "class", "distance", "same shape", box=None, pad_edge=False)
    for match in matches:
        share = match["same_shape"]
        table.add_row(
            shown(match["file"]),
            "unknown" if match["unknown"] else shown(match["class"]),
            f"{match['distance']:.3f}",
            "" if share is None else f"{share:.0%}",
        )
    Console().print(table)


@click.command()
@click.argument("library", type=LIBRARY)
@click.option(
    "--report",
    "page",
    type=click.Path(dir_okay=False, path_type=Path),
    metavar="FILE.html",
    help="Write one page to look the groups over, with pictures.",
)
@click.option(
    "--least",
    type=click.FloatRange(0, 1, min_open=True, max_open=True),
    default=0.85,
    show_default=True,
    help="Least probability that two meshes are one shape.",
)
@model_option
@click.option("--json", "as_json", is_flag=True, help="JSON Lines, as when the output is piped.")
def duplicates(
    library: Path, page: Path | None, least: float, model: str | None, as_json: bool
) -> None:
    """List the groups of a LIBRARY that are the same shape; nothing is changed or deleted.

    Each mesh is told how it differs from the first of its group: in size, in its number of faces,
    as its mirror image, or not at all.
    """
    if page is not None:
        from meshconv3d.service.batch.report import write_groups  # its extra may be missing
    _, found = _open(library, model)
    from meshconv3d.service.library import LibraryError

    with usage_errors(LibraryError):
        rows = found.duplicates(least)
    groups = [
        [
            {
                "file": found.value("file", row),
                "differs": found.relation(group[0], row) if place else "first",
            }
            for place, row in enumerate(group)
        ]
        for group in rows
    ]
    if page is not None:
        pictures = iter(found.pictures([row for group in rows for row in group]))
        drawn = [[(one["file"], one["differs"], next(pictures)) for one in g] for g in groups]
        write_groups(drawn, str(library), len(found), page)
    if as_json or not sys.stdout.isatty():
        for group in groups:
            click.echo(json.dumps(group))
        return
    for group in groups[:SHOWN_GROUPS]:
        click.echo(printable(group[0]["file"]))
        for one in group[1:]:
            click.echo(f"  {printable(one['file'])}: {one['differs']}")
    if len(groups) > SHOWN_GROUPS:
        click.echo(f"and {len(groups) - SHOWN_GROUPS} more groups")
    members = sum(map(len, groups))
    click.echo(f"{members} of {len(found)} meshes are in {len(groups)} groups", err=True)


def _open(path: Path, model: str | None) -> "tuple[Classifier, Library]":
    """A library with a model, by default the one that it was made with. One that cannot be searched
    is a usage error."""
    from meshconv3d.service.library import Library, LibraryError, model_of
    from meshconv3d.service.models import shipped_models

    with usage_errors(LibraryError):
        made_with = model_of(path)
        if model is None and made_with not in shipped_models():
            raise LibraryError(
                f"{path} was made with the model {made_with}, which is none of those that are "
                "shipped: give its file as --model"
            )
        classifier = load_classifier(model or made_with)
        return classifier, Library.read(path, [classifier.model.card])
