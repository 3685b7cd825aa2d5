"""Output of an evaluation: tables for a person, and the files of `evaluate --out`.

The picture needs matplotlib, of the extra `train`.
"""

import json
from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path

import numpy as np
from rich.console import Console
from rich.table import Table

from meshconv3d.service.cli.terminal import shown
from meshconv3d.service.evaluation import ClassFigures, LabelledResult, Report, Timing
from meshconv3d.service.output_files import replacing
from meshconv3d.service.prediction import Failure
from meshconv3d.service.records import readable, record


def write_files(folder: Path, report: Report, results: Sequence[LabelledResult]) -> None:
    """The report, its confusion matrix as a picture, and a record for each file, in order.

    Raises OSError.
    """
    from meshconv3d.model.training.plots import draw_confusion

    with replacing(folder / "report.json") as file:
        file.write(report.model_dump_json(by_alias=True).encode() + b"\n")
    with replacing(folder / "predictions.jsonl") as file:
        for one in results:
            found = record(readable(str(one.sample.path)), one.result)
            line = found.model_dump(mode="json", by_alias=True) | {"truth": one.sample.label}
            file.write(json.dumps(line).encode() + b"\n")
    classes = [figures.class_ for figures in report.classes]
    refused = np.array([figures.refused for figures in report.classes])
    with replacing(folder / "confusion.png") as file:
        draw_confusion(classes, np.array(report.confusion), refused, file)


def print_evaluation(report: Report, results: Sequence[LabelledResult]) -> None:
    """The report, and below it why files were refused."""
    console = Console(highlight=False)
    console.print(_figures(report))
    if report.timing:
        console.print("", _timing(report.timing), sep="\n")
    console.print("", _classes(report.classes), sep="\n")
    for line in _refusals(results):
        console.print(f"[red]{line}[/red]", soft_wrap=True)


def _figures(report: Report) -> Table:
    right = sum(row[i] for i, row in enumerate(report.confusion))
    reasons = ", ".join(f"{fault} {count}" for fault, count in report.reasons.items())
    calibration = (
        "mean over files of |accuracy - confidence| in the file's bin, "
        f"one of {report.calibration_bins} of equal width"
    )
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
    table.add_row(
        "Negative log-likelihood",
        _number(report.negative_log_likelihood),
        "mean of -ln(probability of the true class)",
    )
    if report.timing:
        table.add_row("Files per second", f"{report.timing.files_per_second:.1f}")
    return table


def _timing(timing: Timing) -> Table:
    table = _table("Stage", "Median", "95 % within")
    for stage, spread in timing.stages_ms.items():
        table.add_row(stage, f"{spread.median:.2f} ms", f"{spread.p95:.2f} ms")
    return table


def _classes(classes: Iterable[ClassFigures]) -> Table:
    """Those that have files."""
    table = _table("Class", "Meshes", "Refused", "Recall", "Precision")
    table.add_column("Mostly mistaken for", overflow="fold")
    for figures in classes:
        if figures.files:
            mistake = figures.mistaken_for
            table.add_row(
                shown(figures.class_),
                f"{figures.files}",
                f"{figures.refused}",
                _share(figures.recall),
                _share(figures.precision),
                f"{shown(mistake.class_)} {mistake.files}" if mistake else "",
            )
    return table


def _refusals(results: Iterable[LabelledResult]) -> Iterator[str]:
    for one in results:
        if isinstance(one.result, Failure):
            file = readable(str(one.sample.path))
            yield f"{shown(file)}: {shown(one.result.message)}"


def _table(name: str, *numbers: str) -> Table:
    table = Table(box=None, pad_edge=False)
    table.add_column(name, overflow="fold")
    for heading in numbers:
        table.add_column(heading, justify="right", no_wrap=True)
    return table


def _share(value: float | None) -> str:
    return "-" if value is None else f"{value:.1%}"


def _number(value: float | None) -> str:
    return "-" if value is None else f"{value:.3f}"
