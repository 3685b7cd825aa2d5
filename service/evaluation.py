"""Evaluation of a model on labelled files, which are classified as those of any user.

`Report` is its one public form: in a terminal's tables (`service.evaluation_output`) and as JSON.
"""

from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from pydantic import BaseModel, Field

from meshconv3d.model import metrics
from meshconv3d.model.datasets import Sample
from meshconv3d.model.metrics import CALIBRATION_BINS, Predictions
from meshconv3d.service.classifier import Classifier
from meshconv3d.service.models import Model
from meshconv3d.service.prediction import Failure, ModelId, Prediction, Result

DIGITS = 6


class DataId(BaseModel):
    """Data set of an evaluation: one part of a labelled folder."""

    folder: str = Field(description="as given")
    split_file: str | None = Field(description="as given, if any")
    part: str = Field(examples=["test"])


class Spread(BaseModel):
    """Milliseconds that 50 % and 95 % of the classified files stay within."""

    median: float
    p95: float


class Timing(BaseModel):
    """stages_ms: each stage, and as `total` all of them, of the files that were classified."""

    stages_ms: dict[str, Spread]
    files_per_second: float = Field(description="by the clock, refused files included")


class Mistake(BaseModel):
    """A wrong answer, and how many files of a class got it."""

    class_: str = Field(serialization_alias="class")
    files: int


class ClassFigures(BaseModel):
    """One class of the model. recall is null without files, precision if it was never answered."""

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
    calibration_error: mean over bins of equal width of the highest probability, weighted by their
    files, of |share right - mean probability|. negative_log_likelihood: mean of -ln(probability of
    the true class). confusion: answered files by class (rows) and answer (columns), in the order
    of `classes`.
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
    calibration_bins: int = CALIBRATION_BINS
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
    """The report on files that were classified in `seconds` altogether.

    Raises ValueError for no files, and for a label that is no class of the model.
    """
    classes = model.card.config.classes
    predictions = _predictions(classes, results)
    reasons = Counter(one.result.fault for one in results if isinstance(one.result, Failure))
    unknown = [one for one in results if isinstance(one.result, Prediction) and one.result.unknown]
    answers = not predictions.refused.all()

    def rounded(metric: Callable[..., float], **options: int) -> float:
        return round(metric(predictions, **options), DIGITS)

    return Report(
        model=model.id,
        data=data,
        files=len(results),
        refused=reasons.total(),
        reasons=dict(reasons.most_common()),
        unknown=len(unknown) if model.card.calibration else None,
        accuracy=rounded(metrics.accuracy),
        top5_accuracy=rounded(metrics.accuracy, top=5) if len(classes) > 5 else None,
        balanced_accuracy=rounded(metrics.balanced_accuracy),
        calibration_error=rounded(metrics.calibration_error) if answers else None,
        negative_log_likelihood=rounded(metrics.negative_log_likelihood) if answers else None,
        timing=_timing(results, seconds) if answers else None,
        classes=_class_figures(classes, predictions),
        confusion=metrics.confusion_matrix(predictions).tolist(),
    )


def _predictions(classes: Sequence[str], results: Sequence[LabelledResult]) -> Predictions:
    index = {name: number for number, name in enumerate(classes)}
    if unknown := {one.sample.label for one in results} - set(index):
        raise ValueError(f"labels that are no class of the model: {sorted(unknown)}")
    probabilities = np.zeros((len(results), len(classes)))
    refused = np.zeros(len(results), dtype=bool)
    for row, one in enumerate(results):
        if isinstance(one.result, Prediction):
            probabilities[row] = one.result.probabilities
        else:
            refused[row] = True
    labels = np.array([index[one.sample.label] for one in results], dtype=np.intp)
    return Predictions(labels, probabilities, refused)


def _timing(results: Sequence[LabelledResult], seconds: float) -> Timing:
    timings = [r.result.timings_ms for r in results if isinstance(r.result, Prediction)]
    stages = {stage: [timing[stage] for timing in timings] for stage in timings[0]}
    stages["total"] = [sum(timing.values()) for timing in timings]
    return Timing(
        stages_ms={stage: _spread(values) for stage, values in stages.items()},
        files_per_second=round(len(results) / seconds, 3),
    )


def _spread(values: Sequence[float]) -> Spread:
    median, p95 = np.percentile(values, [50, 95])
    return Spread(median=round(float(median), 3), p95=round(float(p95), 3))


def _class_figures(classes: Sequence[str], predictions: Predictions) -> list[ClassFigures]:
    files = metrics.class_counts(predictions)
    refused = metrics.refused_counts(predictions)
    recalls, precisions = metrics.recalls(predictions), metrics.precisions(predictions)
    wrong = metrics.confusion_matrix(predictions)
    np.fill_diagonal(wrong, 0)
    return [
        ClassFigures(
            class_=name,
            files=int(files[i]),
            refused=int(refused[i]),
            recall=_or_none(recalls[i]),
            precision=_or_none(precisions[i]),
            mistaken_for=(
                Mistake(class_=classes[int(wrong[i].argmax())], files=int(wrong[i].max()))
                if wrong[i].any()
                else None
            ),
        )
        for i, name in enumerate(classes)
    ]


def _or_none(share: float) -> float | None:
    return None if np.isnan(share) else round(float(share), DIGITS)
