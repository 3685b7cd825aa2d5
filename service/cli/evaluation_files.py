"""What `evaluate --out` writes. It draws: importing it needs matplotlib, of the extra `train`."""

import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from meshconv3d.model.training.plots import draw_confusion
from meshconv3d.service.evaluation import Outcome
from meshconv3d.service.evaluation_report import Report
from meshconv3d.service.records import readable, record


def write_files(folder: Path, report: Report, outcomes: Sequence[Outcome]) -> None:
    """The report, its confusion matrix as a picture, and a record for each file, in order."""
    document = report.model_dump_json(by_alias=True) + "\n"
    (folder / "report.json").write_text(document, encoding="utf-8")
    classes = [figures.class_ for figures in report.classes]
    refused = np.array([figures.refused for figures in report.classes])
    draw_confusion(classes, np.array(report.confusion), refused, folder / "confusion.png")
    with (folder / "predictions.jsonl").open("w", encoding="utf-8") as lines:
        lines.writelines(json.dumps(_record(outcome)) + "\n" for outcome in outcomes)


def _record(outcome: Outcome) -> dict[str, Any]:
    """What `classify` says of a file, and its true class."""
    found = record(readable(str(outcome.sample.path)), outcome.result)
    return found.model_dump(mode="json", by_alias=True) | {"truth": outcome.sample.label}
