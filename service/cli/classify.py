"""`meshconv3d classify`: files and folders in, a record for each file out."""

import sys
from collections.abc import Iterable
from pathlib import Path
from typing import TYPE_CHECKING

import click

from meshconv3d.service.cli.shared import read_settings

if TYPE_CHECKING:
    from meshconv3d.service.batch.classifying import Outcome
    from meshconv3d.service.batch.outputs import Output
    from meshconv3d.service.batch.targets import Target
    from meshconv3d.service.batch.uses import Uses
    from meshconv3d.service.cli.sinks import Sink
    from meshconv3d.service.cli.watching import Watch

# The class and its runner-up: with more, the table outgrows a terminal of 80 columns.
TABLE_TOP = 2


@click.command()
@click.argument("paths", nargs=-1, required=True, metavar="PATH...")
@click.option(
    "--model",
    help="Shipped model by name, or a model file. [default: MESHCONV3D_MODELS, or shrec11]",
)
@click.option("--top", type=click.IntRange(1), help="Only the N likeliest classes of each.")
@click.option("--json", "as_json", is_flag=True, help="JSON Lines, as when the output is piped.")
@click.option("--format", "declared", help="Format of the mesh on standard input, such as stl.")
@click.option(
    "--include",
    multiple=True,
    metavar="GLOB",
    help="Of folders, only files that fit; a GLOB with a / is held against the path below PATH.",
)
@click.option("--exclude", multiple=True, metavar="GLOB", help="Of folders, not those that fit.")
@click.option("--shard", metavar="I/N", help="Only part I of N, the same one on every machine.")
@click.option(
    "--output",
    metavar="FILE",
    help="Write the records to FILE.jsonl, .csv or .parquet, safe from any interruption.",
)
@click.option("--resume", is_flag=True, help="Go on with an --output that was interrupted.")
@click.option("--unordered", is_flag=True, help="Records as they are done, which is faster.")
@click.option(
    "--workers",
    type=click.IntRange(1, 256),
    help="Processes that classify. [default: one for each usable core, or none for a few files]",
)
@click.option(
    "--engine",
    "engine_name",
    type=click.Choice(["local", "ray"]),
    default="local",
    help="Where files are classified: on this machine, or over a Ray cluster. [default: local]",
)
@click.option(
    "--ray-address",
    metavar="ADDRESS",
    help="The cluster, as HOST:PORT or auto. [default: RAY_ADDRESS, or one of this machine alone]",
)
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
    include: tuple[str, ...],
    exclude: tuple[str, ...],
    shard: str | None,
    output: str | None,
    resume: bool,
    unordered: bool,
    workers: int | None,
    engine_name: str,
    ray_address: str | None,
    folder: Path | None,
    page: Path | None,
    out: Path | None,
    label: str | None,
) -> None:
    """Say what the meshes in files and folders are; - reads one mesh from standard input.

    A PATH is a file, a folder, which is searched recursively, a glob in quotes, or a URL such as
    s3://bucket/folder. Prints a table at a terminal and JSON Lines otherwise, in the order of the
    input, or writes an --output. A file that cannot be used is a record with its reason. Exits
    with 0 if every file was classified, 1 if some were not, 2 if the call itself is wrong.
    """
    if label is not None and out is None:
        raise click.UsageError("--class says what to explain: add --explain OUT")
    if out is not None and workers is not None:
        raise click.UsageError("--explain works in one process: leave out --workers")
    if resume and output is None:
        raise click.UsageError("--resume goes on with an output: add --output FILE")
    if ray_address is not None and engine_name != "ray":
        raise click.UsageError("--ray-address is of a Ray cluster: add --engine ray")
    if engine_name == "ray" and (out is not None or "-" in paths):
        raise click.UsageError("--explain and - are for this machine: leave out --engine ray")
    from meshconv3d.service.batch.classifying import Options, run_id
    from meshconv3d.service.batch.uses import Uses
    from meshconv3d.service.cli.engines import FEW, explaining_engine, open_engine, ray_engine
    from meshconv3d.service.cli.places import check_folder, check_page, listing_of, target_of
    from meshconv3d.service.cli.watching import Watch

    listing = listing_of(paths, declared, include, exclude, shard)
    if folder is not None:
        check_folder(folder, listing)
    if page is not None:
        check_page(page)
    target = None if output is None else target_of(output, resume)
    settings = read_settings({"workers": workers})
    ordered, pictured = not unordered, page is not None
    if out is not None:
        model_id, engine = explaining_engine(listing, model, out, label)
    elif engine_name == "ray":
        model_id, engine = ray_engine(model, settings, workers, ordered, pictured, ray_address)
    else:
        here = workers is None
        model_id, engine = open_engine(listing, model, settings, here, ordered, pictured)
    at_terminal = target is None and not as_json and sys.stdout.isatty()
    top = TABLE_TOP if at_terminal and top is None else top
    options = Options(model_id.name, top, settings.worker_memory_bytes)
    watch = Watch(listing, shown=at_terminal or not sys.stdout.isatty() or target is not None)
    uses = Uses(folder, page, model_id, ", ".join(paths))
    run = run_id(model_id.sha256, top, settings.limits)
    with engine:
        sink = _output(target, run, uses) if target else _printer(at_terminal, watch)
        outcomes = uses.of(engine.outcomes(listing, options, sink.done_as))
        _follow(watch, outcomes, sink, target)
    uses.close(watch.seconds)
    if target is not None or (watch.shown and sink.tally.files > FEW):
        click.echo(watch.summary(sink.tally), err=True)
    ctx.exit(1 if sink.tally.refused else 0)


def _output(target: "Target", run: str, uses: "Uses") -> "Output":
    """The output file. One that is not of this run is a usage error."""
    from meshconv3d.service.batch.outputs import Output
    from meshconv3d.service.batch.targets import NotWritten

    try:
        return Output(target, run, uses.earlier)
    except NotWritten as error:
        raise click.UsageError(f"--output {error}") from None


def _printer(at_terminal: bool, watch: "Watch") -> "Sink":
    from meshconv3d.service.cli.sinks import Lines, Tables

    return Tables(watch.paused) if at_terminal else Lines()


def _follow(
    watch: "Watch", outcomes: "Iterable[Outcome]", sink: "Sink", target: "Target | None"
) -> None:
    """Hand all outcomes to the sink, which keeps what it has however that ends."""
    from meshconv3d.service.batch.engines import EngineFailed

    try:
        watch.follow(outcomes, sink)
    except (KeyboardInterrupt, OSError):
        if target is not None:
            click.echo(f"{target.path} has what is done: go on with it by --resume", err=True)
        raise
    except EngineFailed as error:
        raise click.ClickException(str(error)) from None
    finally:
        sink.close()
