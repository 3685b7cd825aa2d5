"""`meshconv3d classify`: files in, a record for each out."""

import sys
from collections import Counter

import click

from meshconv3d.service.cli.setup import (
    format_option,
    list_files,
    model_option,
    pool_executor,
    read_settings,
    serial_executor,
    top_option,
)

# As many files are classified in this process before worker processes would be ready.
FEW = 16
# Above so many, a hint names `meshconv3d batch`.
MANY = 200


@click.command()
@click.argument("paths", nargs=-1, required=True, metavar="PATH...")
@model_option
@top_option
@click.option("--json", "as_json", is_flag=True, help="JSON Lines, as when the output is piped.")
@format_option
@click.pass_context
def classify(
    ctx: click.Context,
    paths: tuple[str, ...],
    model: str | None,
    top: int | None,
    as_json: bool,
    declared: str | None,
) -> None:
    """Say what the meshes in files and folders are; - reads one mesh from standard input.

    A PATH is a file, a folder, which is searched recursively, a glob in quotes, or a URL such as
    s3://bucket/folder. Prints a table at a terminal and JSON Lines otherwise, in the order of the
    input. A file that cannot be used is a record with its reason. For many files, see `meshconv3d
    batch`, which loses nothing where it is interrupted. Exits with 0 if every file was classified,
    1 if some were not, 2 if the call itself is wrong.
    """
    settings = read_settings({})
    listing = list_files(paths, declared=declared)
    few = len(listing.first(FEW + 1)) <= FEW
    _, executor = (serial_executor if few else pool_executor)(model, settings)

    from meshconv3d.service.batch.listing import told
    from meshconv3d.service.batch.running import Tally
    from meshconv3d.service.cli.terminal import Printer, Progress, TablePrinter

    at_terminal = sys.stdout.isatty()
    others: Counter[str] = Counter()
    tally = Tally()
    progress = Progress(listing, tally, quiet=as_json and at_terminal)
    tables = at_terminal and not as_json
    printer = TablePrinter(top) if tables else Printer(top)
    with executor, printer, progress:
        for one in executor.results(listing.files(others), lambda _: ()):
            tally.add(one.fault)
            printer.add(one.file.name, one.result)
            progress.update()
    if progress.shown and tally.files > FEW:
        click.echo(progress.summary(), err=True)
    if progress.shown and tally.files > MANY:
        click.echo("To keep what is done if it is interrupted: meshconv3d batch", err=True)
    if others:
        click.echo(told(others), err=True)
    ctx.exit(1 if tally.refused else 0)
