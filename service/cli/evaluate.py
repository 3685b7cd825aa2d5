"""`meshconv3d evaluate`: a labelled folder in, how good a model is on it out."""

import sys
import time
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import click

from meshconv3d.service.cli.setup import load_classifier, usage_errors

if TYPE_CHECKING:
    from meshconv3d.model.datasets import Sample


@click.command()
@click.argument("model")
@click.argument("data", type=click.Path(exists=True, file_okay=False, path_type=Path))
@click.option(
    "--split",
    "split_file",
    type=click.Path(exists=True, dir_okay=False, path_type=Path),
    help="CSV with the columns class,file,split (train, val, test).",
)
@click.option(
    "--part",
    type=click.Choice(["train", "val", "test"]),
    default="test",
    show_default=True,
    help="Which part of the split.",
)
@click.option(
    "--out",
    type=click.Path(file_okay=False, writable=True, path_type=Path),
    help="Folder to write report.json, predictions.jsonl and confusion.png to.",
)
@click.option("--json", "as_json", is_flag=True, help="JSON, as when the output is piped.")
@click.pass_context
def evaluate(
    ctx: click.Context,
    model: str,
    data: Path,
    split_file: Path | None,
    part: str,
    out: Path | None,
    as_json: bool,
) -> None:
    """Measure how good MODEL, a shipped model's name or a model file, is on DATA.

    DATA is laid out as CLASS/test/*.obj, or as CLASS/*.obj, which is all test; its classes must
    be some of the model's. Files are classified as `classify` does it. Prints tables at a
    terminal and one JSON document otherwise. A file that cannot be used counts as wrong. Exits
    with 0 if every file was classified, 1 if some were not, 2 if the call itself is wrong.
    """
    if out:
        # Now, since it needs an extra: after an hour of work it is too late to say so.
        import meshconv3d.model.training.plots  # noqa: F401
    from meshconv3d.service.cli.terminal import with_progress
    from meshconv3d.service.evaluation import DataId, classify_samples, summarise
    from meshconv3d.service.evaluation_output import print_evaluation, write_files
    from meshconv3d.service.records import readable

    classifier = load_classifier(model)
    samples = _find(data, split_file, part, classifier.model.card.config.classes)
    if out:
        out.mkdir(parents=True, exist_ok=True)
    started = time.perf_counter()
    results = list(with_progress(classify_samples(classifier, samples), len(samples)))
    seconds = time.perf_counter() - started
    split = readable(str(split_file)) if split_file else None
    measured = DataId(folder=readable(str(data)), split_file=split, part=part)
    report = summarise(classifier.model, measured, results, seconds)
    if out:
        write_files(out, report, results)
    if as_json or not sys.stdout.isatty():
        click.echo(report.model_dump_json(by_alias=True).encode())
    else:
        print_evaluation(report, results)
    ctx.exit(1 if report.refused else 0)


def _find(data: Path, split_file: Path | None, part: str, known: Sequence[str]) -> "list[Sample]":
    """The files to classify. None at all, or of a class that the model lacks, is a usage error."""
    from meshconv3d.model.datasets import DatasetError, class_names, list_samples

    with usage_errors(DatasetError):
        listed = list_samples(data, split_file)
    samples = [sample for sample in listed if sample.split == part]
    if not samples and listed:
        parts = " or ".join(sorted({sample.split for sample in listed}))
        raise click.UsageError(f"no meshes of the part {part} under {data}: choose --part {parts}")
    if not samples:
        raise click.UsageError(
            f"no labelled meshes under {data}: expected {data}/CLASS/{part}/*.obj or "
            f"{data}/CLASS/*.obj (or another mesh format)"
        )
    if unknown := [name for name in class_names(samples) if name not in known]:
        raise click.UsageError(
            f"classes of {data} that the model does not know: {', '.join(unknown)} "
            "(meshconv3d inspect MODEL shows those that it knows)"
        )
    return samples
