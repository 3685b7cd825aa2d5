"""`meshconv3d evaluate`: figures of a model on a labelled folder."""

import sys
import time
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import click

from meshconv3d.service.cli.setup import load_classifier, usage_errors

if TYPE_CHECKING:
    from rich.table import Table

    from meshconv3d.model.datasets import Sample
    from meshconv3d.service.evaluation import ClassFigures, LabelledResult, Report


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
        # First, as it needs an extra that may be missing.
        import meshconv3d.model.training.plots  # noqa: F401
    from rich.console import Console
    from rich.progress import track

    from meshconv3d.service.evaluation import DataId, classify_samples, summarise, write_files
    from meshconv3d.service.records import readable

    classifier = load_classifier(model)
    samples = _find(data, split_file, part, classifier.model.card.config.classes)
    if out:
        out.mkdir(parents=True, exist_ok=True)
    started = time.perf_counter()
    console = Console(stderr=True)
    results = list(
        track(
            classify_samples(classifier, samples),
            "Classifying",
            len(samples),
            console=console,
            transient=True,
            disable=len(samples) == 1 or not console.is_terminal,
        )
    )
    seconds = time.perf_counter() - started
    split = readable(str(split_file)) if split_file else None
    measured = DataId(folder=readable(str(data)), split_file=split, part=part)
    report = summarise(classifier.model, measured, results, seconds)
    if out:
        write_files(out, report, results)
    if as_json or not sys.stdout.isatty():
        click.echo(report.model_dump_json(by_alias=True).encode())
    else:
        _print(report, results)
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


def _print(report: "Report", results: "Sequence[LabelledResult]") -> None:
    """Tables of the report, and below them why files were refused."""
    from rich.console import Console

    from meshconv3d.service.cli.terminal import shown
    from meshconv3d.service.prediction import Failure
    from meshconv3d.service.records import readable

    console = Console(highlight=False)
    console.print(_figures(report))
    if report.timing:
        stages = _table("Stage", "Median", "95 % within")
        for stage, spread in report.timing.stages_ms.items():
            stages.add_row(stage, f"{spread['median']:.2f} ms", f"{spread['p95']:.2f} ms")
        console.print("", stages, sep="\n")
    console.print("", _classes(report.classes), sep="\n")
    for one in results:
        if isinstance(one.result, Failure):
            file, message = readable(str(one.sample.path)), one.result.message
            console.print(f"[red]{shown(file)}: {shown(message)}[/red]", soft_wrap=True)


def _figures(report: "Report") -> "Table":
    from rich.table import Table

    right = sum(row[i] for i, row in enumerate(report.confusion))
    reasons = ", ".join(f"{fault} {count}" for fault, count in report.reasons.items())
    calibration = (
        "mean over files of |accuracy - confidence| in the file's bin, "
        f"one of {report.calibration_bins} of equal width"
    )
    likelihood = "mean of -ln(probability of the true class)"
    table = Table(box=None, pad_edge=False, show_header=False)
    table.add_column(no_wrap=True)
    table.add_column(justify="right", style="bold", no_wrap=True)
    table.add_column()
    table.add_row("Accuracy", _share(report.accuracy), f"{right} of {report.files} files")
    if report.top5_accuracy is not None:
        table.add_row("Top-5 accuracy", _share(report.top5_accuracy))
    table.add_row("Balanced accuracy", _share(report.balanced_accuracy), "mean recall of classes")
    table.add_row("Refused", f"{report.refused}", reasons)
    if report.unknown is not None:
        share = f"{report.unknown / report.files:.1%} of the files"
        table.add_row("Called unknown", f"{report.unknown}", share)
    table.add_row("Calibration error", _number(report.calibration_error), calibration)
    table.add_row("Negative log-likelihood", _number(report.negative_log_likelihood), likelihood)
    if report.timing:
        table.add_row("Files per second", f"{report.timing.files_per_second:.1f}")
    return table


def _classes(classes: "Iterable[ClassFigures]") -> "Table":
    """Figures of the classes that have files."""
    from meshconv3d.service.cli.terminal import shown

    table = _table("Class", "Meshes", "Refused", "Recall", "Precision")
    table.add_column("Mostly mistaken for", overflow="fold")
    for one in classes:
        if one.files:
            mistake = one.mistaken_for
            table.add_row(
                shown(one.class_),
                f"{one.files}",
                f"{one.refused}",
                _share(one.recall),
                _share(one.precision),
                f"{shown(mistake.class_)} {mistake.files}" if mistake else "",
            )
    return table


def _table(name: str, *numbers: str) -> "Table":
    from rich.table import Table

    table = Table(box=None, pad_edge=False)
    table.add_column(name, overflow="fold")
    for heading in numbers:
        table.add_column(heading, justify="right", no_wrap=True)
    return table


def _share(value: float | None) -> str:
    return "-" if value is None else f"{value:.1%}"


def _number(value: float | None) -> str:
    return "-" if value is None else f"{value:.3f}"
