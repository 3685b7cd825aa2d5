"""Evaluation of a model on labelled files, classified as those of any user.

`Report` is its one public form: in a terminal's tables (`service.cli.evaluate`) and as JSON.
"""

import json
from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from pydantic import BaseModel, Field

from meshconv3d.model import metrics
from meshconv3d.model.datasets import Sample
from meshconv3d.model.files import replacing
from meshconv3d.service.classifier import Classifier
from meshconv3d.service.models import Model
from meshconv3d.service.prediction import Failure, ModelId, Prediction, Result
from meshconv3d.service.records import readable, record

DIGITS = 6


class DataId(BaseModel):
    """Data set of an evaluation: one part of a labelled folder."""

    folder: str = Field(description="as given")
    split_file: str | None = Field(description="as given, if any")
    part: str = Field(examples=["test"])


class Timing(BaseModel):
    """stages_ms: `median` and `p95` of each stage, and of all as `total`, over classified files."""

    stages_ms: dict[str, dict[str, float]]
    files_per_second: float = Field(description="by the clock, refused files included")


class Mistake(BaseModel):
    """Wrong answer, with the number of files of a class that got it."""

    class_: str = Field(serialization_alias="class")
    files: int


class ClassFigures(BaseModel):
    """Figures of one class. recall is null without files, precision if it was never answered."""

    class_: str = Field(serialization_alias="class")
    files: int
    refused: int
    recall: float | None
    precision: float | None
    mistaken_for: Mistake | None = Field(description="the most frequent wrong answer")


class Report(BaseModel):
    """Figures of an evaluation. Refused files count as wrong in each accuracy.

    top5_accuracy is null for a model of five classes or fewer, and what is measured on answers is
    null if there are none. balanced_accuracy: mean recall of the classes that have files.
    calibration_error, negative_log_likelihood: see `model.metrics`. confusion: answered files by
    class (rows) and answer (columns), in the order of `classes`.
    """

    model: ModelId
    data: DataId
    files: int
    refused: int
    reasons: dict[str, int] = Field(description="refused files by fault")
    unknown: int | None = Field(
        description="files that were called unknown, whatever their nearest class; null if the "
        "model calls nothing so"
    )
    accuracy: float
    top5_accuracy: float | None
    balanced_accuracy: float
    calibration_error: float | None
    calibration_bins: int = metrics.CALIBRATION_BINS
    negative_log_likelihood: float | None
    timing: Timing | None
    classes: list[ClassFigures]
    confusion: list[list[int]]


@dataclass(frozen=True, eq=False)
class LabelledResult:
    """Result of one labelled file."""

    sample: Sample
    result: Result


def classify_samples(classifier: Classifier, samples: Sequence[Sample]) -> Iterator[LabelledResult]:
    """Classify labelled files one after the other, in order."""
    results = classifier.classify_many(sample.path for sample in samples)
    for sample, result in zip(samples, results, strict=True):
        one = result if isinstance(result, Prediction) else Failure.of(result)
        yield LabelledResult(sample, one)


def summarise(
    model: Model, data: DataId, results: Sequence[LabelledResult], seconds: float
) -> Report:
    """Report on one file or more, which were classified in `seconds` altogether."""
    classes = model.card.config.classes
    answered = [one for one in results if isinstance(one.result, Prediction)]
    predictions = [one.result for one in answered if isinstance(one.result, Prediction)]
    labels = np.array([classes.index(one.sample.label) for one in answered], np.intp)
    probabilities = np.array([found.probabilities for found in predictions])
    probabilities = probabilities.reshape(len(labels), len(classes))
    confusion = metrics.confusion_matrix(labels, probabilities)
    reasons = Counter(one.result.fault for one in results if isinstance(one.result, Failure))
    files = Counter(one.sample.label for one in results)
    figures = _class_figures(classes, files, confusion)
    recalls = [one.recall for one in figures if one.recall is not None]
    right, right5 = (
        round(float(metrics.is_among_top(labels, probabilities, top).sum()) / len(results), DIGITS)
        for top in (1, 5)
    )
    measured = [None, None]
    if predictions:
        measured = [
            round(measure(labels, probabilities), DIGITS)
            for measure in (metrics.calibration_error, metrics.negative_log_likelihood)
        ]
    return Report(
        model=model.id,
        data=data,
        files=len(results),
        refused=reasons.total(),
        reasons=dict(reasons.most_common()),
        unknown=sum(bool(p.unknown) for p in predictions) if model.card.calibration else None,
        accuracy=right,
        top5_accuracy=right5 if len(classes) > 5 else None,
        balanced_accuracy=round(sum(recalls) / len(recalls), DIGITS),
        calibration_error=measured[0],
        negative_log_likelihood=measured[1],
        timing=_timing(predictions, len(results) / seconds) if predictions else None,
        classes=figures,
        confusion=confusion.tolist(),
    )


def _timing(predictions: Sequence[Prediction], rate: float) -> Timing:
    timings = [prediction.timings_ms for prediction in predictions]
    stages = {stage: [timing[stage] for timing in timings] for stage in timings[0]}
    stages["total"] = [sum(timing.values()) for timing in timings]
    spreads = {stage: np.percentile(values, [50, 95]).round(3) for stage, values in stages.items()}
    return Timing(
        stages_ms={stage: {"median": a, "p95": b} for stage, (a, b) in spreads.items()},
        files_per_second=round(rate, 3),
    )


def _class_figures(
    classes: Sequence[str], files: Counter[str], confusion: NDArray[np.intp]
) -> list[ClassFigures]:
    """files: by class. confusion: see `Report`."""
    found = []
    for i, name in enumerate(classes):
        right, answers = int(confusion[i, i]), int(confusion[:, i].sum())
        others = confusion[i] * (np.arange(len(classes)) != i)
        worst = Mistake(class_=classes[int(others.argmax())], files=int(others.max()))
        found.append(
            ClassFigures(
                class_=name,
                files=files[name],
                refused=files[name] - int(confusion[i].sum()),
                recall=round(right / files[name], DIGITS) if files[name] else None,
                precision=round(right / answers, DIGITS) if answers else None,
                mistaken_for=worst if worst.files else None,
            )
        )
    return found


def write_files(folder: Path, report: Report, results: Sequence[LabelledResult]) -> None:
    """Write the report, its confusion matrix as a picture, and a record for each file, in order.

    Needs matplotlib, of the extra `train`. Raises OSError.
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
