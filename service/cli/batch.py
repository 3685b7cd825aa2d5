"""`meshconv3d batch`: folders of any size in, one output file out, safe from any interruption."""

import os
from collections import Counter
from collections.abc import Callable, Sequence
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
    top_option,
    usage_errors,
    worker_setup,
    workers_option,
)

if TYPE_CHECKING:
    from meshconv3d.service.batch.listing import Choice, Listing
    from meshconv3d.service.batch.outputs import Output
    from meshconv3d.service.batch.resume import Entry
    from meshconv3d.service.batch.running import Executor, FileResult
    from meshconv3d.service.cli.terminal import Progress
    from meshconv3d.service.prediction import ModelId
    from meshconv3d.service.settings import Settings


@click.command()
@click.argument("paths", nargs=-1, required=True, metavar="PATH...")
@click.option(
    "-o",
    "--output",
    "file",
    required=True,
    metavar="FILE",
    help="Write the records to FILE.jsonl, .csv or .parquet.",
)
@resume_option
@model_option
@top_option
@click.option("--include", multiple=True, metavar="GLOB", help="Of folders, only files that fit.")
@click.option("--exclude", multiple=True, metavar="GLOB", help="Of folders, not those that fit.")
@click.option("--shard", metavar="I/N", help="Only part I of N, the same one on every machine.")
@workers_option
@click.option("--ray", metavar="ADDRESS", help="On a Ray cluster: HOST:PORT, auto or local.")
@click.option(
    "--sort-into",
    "folder",
    type=click.Path(file_okay=False, path_type=Path),
    metavar="DIR",
    help="Link or copy each file into DIR/CLASS, DIR/unknown or DIR/refused.",
)
@click.option(
    "--report",
    "page",
    type=click.Path(dir_okay=False, path_type=Path),
    metavar="FILE",
    help="Write one page to FILE.html to look all results over, with pictures.",
)
@click.pass_context
def batch(
    ctx: click.Context,
    paths: tuple[str, ...],
    file: str,
    resume: bool,
    model: str | None,
    top: int | None,
    include: tuple[str, ...],
    exclude: tuple[str, ...],
    shard: str | None,
    workers: int | None,
    ray: str | None,
    folder: Path | None,
    page: Path | None,
) -> None:
    """Classify folders of any size into one file, which no interruption damages.

    A PATH is a file, a folder, which is searched recursively, a glob in quotes, or a URL such as
    s3://bucket/folder. Records are in the order of the input; a file that cannot be used is one
    with its reason. After an interruption, the same call with --resume goes on. Exits with 0 if
    every file was classified, 1 if some were not, 2 if the call itself is wrong.
    """
    from meshconv3d.service.batch.outputs import Output
    from meshconv3d.service.batch.resume import NotWritten
    from meshconv3d.service.batch.running import FileResult, run_id
    from meshconv3d.service.batch.sort import SortedFolder
    from meshconv3d.service.records import record

    listing = list_files(paths, _choice(include, exclude, shard))
    _check(listing, folder, page)
    with usage_errors(NotWritten, option="--output"):
        output = Output(file, resume)
    settings = read_settings({"workers": workers})
    if page is not None:
        from meshconv3d.service.batch.report import Report, write_page
    if ray is None:
        model_id, executor = pool_executor(model, settings, page is not None)
    else:
        model_id, executor = _ray_executor(model, settings, workers, ray, page is not None)
    report = None if page is None else Report(model_id, ", ".join(paths))
    sorted_folder = None if folder is None else SortedFolder(folder)

    unplaced = 0

    def add(one: FileResult) -> None:
        nonlocal unplaced
        found = record(one.file.name, one.result, top)
        if sorted_folder is not None and sorted_folder.place(one) is None:
            unplaced += 1
        if report is not None:
            report.add(found, one.picture, one.embedding)
        # Last: a run that is killed and goes on has all in the folder and the report.
        output.add(found, one.sha256)

    run = run_id(model_id.sha256, top, settings.limits)
    progress = write_output(
        output, run, executor, listing, add, report.add if report else lambda _: None
    )
    if report is not None and page is not None:
        write_page(report, page, progress.seconds)
    if unplaced:
        files = "file" if unplaced == 1 else "files"
        click.echo(
            f"could not be read, and so not sorted into {folder}: {unplaced} {files}", err=True
        )
    ctx.exit(1 if output.tally.refused else 0)


def write_output(
    output: "Output",
    run: str,
    executor: "Executor",
    listing: "Listing",
    add: "Callable[[FileResult], None]",
    add_earlier: "Callable[[Entry], None]" = lambda _: None,
) -> "Progress":
    """Classify the files of a listing into an output, with progress and a summary.

    add: takes each result, and adds it to the output. add_earlier: takes the entries of a run that
    is resumed.
    """
    from meshconv3d.service.batch.listing import told
    from meshconv3d.service.batch.resume import NotWritten
    from meshconv3d.service.cli.terminal import Progress

    others: Counter[str] = Counter()
    with executor:
        with usage_errors(NotWritten, option="--output"):
            for earlier in output.begin(run):
                add_earlier(earlier)
        progress = Progress(listing, output.tally)
        try:
            with output, progress:
                for one in executor.results(listing.files(others), output.done_as):
                    add(one)
                    progress.update()
        except (KeyboardInterrupt, OSError):
            path = output.journal_path
            click.echo(f"{path} has what is done: go on with it by --resume", err=True)
            raise
    click.echo(progress.summary(), err=True)
    if others:
        click.echo(told(others), err=True)
    return progress


def _choice(include: Sequence[str], exclude: Sequence[str], shard: str | None) -> "Choice":
    from meshconv3d.service.batch.listing import Choice, Shard

    with usage_errors(ValueError, option="--shard"):
        return Choice(include, exclude, None if shard is None else Shard.parse(shard))


def _check(listing: "Listing", folder: Path | None, page: Path | None) -> None:
    """Usage errors: standard input; a folder to sort into that would itself be classified; a report
    that would replace something else than a page, or cannot be written once all is done."""
    from meshconv3d.service.batch.listing import STDIN
    from meshconv3d.service.batch.sort import DEPTHS

    for place in listing.places:
        if place.path == STDIN:
            raise click.UsageError("batch is for files; standard input: meshconv3d classify -")
        if folder is not None and any(place.may_find(folder, depth) for depth in DEPTHS):
            raise click.UsageError(
                f"--sort-into {folder} lies in {place.path}, and would be classified the next "
                "time: name a folder beside it"
            )
    if page is not None and page.suffix.lower() != ".html":
        raise click.UsageError(f"--report {page} does not end with .html: name a page")
    if page is not None and not (page.parent.is_dir() and os.access(page.parent, os.W_OK)):
        raise click.UsageError(
            f"--report {page} cannot be written: {page.parent} is no folder that you may write to"
        )


def _ray_executor(
    model: str | None, settings: "Settings", workers: int | None, address: str, pictured: bool
) -> "tuple[ModelId, Executor]":
    from meshconv3d.service.batch.ray_engine import RayExecutor
    from meshconv3d.service.batch.running import Options

    model_id = load_classifier(model).model.id
    setup = worker_setup(model, settings, pictured)
    options = Options(model_id.name, settings.worker_memory_bytes)
    return model_id, RayExecutor(setup, workers, address, options)
