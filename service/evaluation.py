"""How good a model is on labelled files, which it classifies as those of any user."""

from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from meshconv3d.model import metrics
from meshconv3d.model.datasets import Sample
from meshconv3d.model.metrics import Predictions
from meshconv3d.service.classifier import Classifier
from meshconv3d.service.evaluation_report import (
    ClassFigures,
    DataId,
    Mistake,
    Report,
    Spread,
    Timing,
)
from meshconv3d.service.models import Model
from meshconv3d.service.prediction import Failure, Prediction, Result

DIGITS = 6


@dataclass(frozen=True, eq=False)
class Outcome:
    """What became of one labelled file."""

    sample: Sample
    result: Result


def classify_samples(classifier: Classifier, samples: Sequence[Sample]) -> Iterator[Outcome]:
    """Classify labelled files one after the other, in order."""
    results = classifier.classify_many(sample.path for sample in samples)
    for sample, result in zip(samples, results, strict=True):
        if not isinstance(result, Prediction):
            # Not the exception: its traceback would keep every mesh that it passed in memory.
            result = Failure.of(result)
        yield Outcome(sample, result)


def summarise(model: Model, data: DataId, outcomes: Sequence[Outcome], seconds: float) -> Report:
    """The report on files that were classified in `seconds` altogether.

    Raises ValueError for no files, and for a label that is no class of the model.
    """
    predictions = _predictions(model.card.config.classes, outcomes)
    reasons = Counter(o.result.fault for o in outcomes if isinstance(o.result, Failure))
    answers = not predictions.refused.all()
    return Report(
        model=model.id,
        data=data,
        files=len(outcomes),
        refused=reasons.total(),
        reasons=dict(reasons.most_common()),
        unknown=_called_unknown(outcomes) if model.card.calibration else None,
        accuracy=round(metrics.accuracy(predictions), DIGITS),
        top5_accuracy=(
            round(metrics.accuracy(predictions, top=5), DIGITS) if predictions.classes > 5 else None
        ),
        balanced_accuracy=round(metrics.balanced_accuracy(predictions), DIGITS),
        calibration_error=(
            round(metrics.calibration_error(predictions), DIGITS) if answers else None
        ),
        negative_log_likelihood=(
            round(metrics.negative_log_likelihood(predictions), DIGITS) if answers else None
        ),
        timing=_timing(outcomes, seconds) if answers else None,
        classes=_class_figures(model.card.config.classes, predictions),
        confusion=metrics.confusion_matrix(predictions).tolist(),
    )


def _called_unknown(outcomes: Sequence[Outcome]) -> int:
    results = (outcome.result for outcome in outcomes)
    return sum(isinstance(result, Prediction) and result.unknown is True for result in results)


def _predictions(classes: Sequence[str], outcomes: Sequence[Outcome]) -> Predictions:
    index = {name: number for number, name in enumerate(classes)}
    if unknown := {outcome.sample.label for outcome in outcomes} - set(index):
        raise ValueError(f"labels that are no class of the model: {sorted(unknown)}")
    probabilities = np.zeros((len(outcomes), len(classes)))
    refused = np.zeros(len(outcomes), dtype=bool)
    for row, outcome in enumerate(outcomes):
        if isinstance(outcome.result, Prediction):
            probabilities[row] = outcome.result.probabilities
        else:
            refused[row] = True
    labels = np.array([index[outcome.sample.label] for outcome in outcomes], dtype=np.intp)
    return Predictions(labels, probabilities, refused)


def _timing(outcomes: Sequence[Outcome], seconds: float) -> Timing:
    timings = [o.result.timings_ms for o in outcomes if isinstance(o.result, Prediction)]
    stages = {stage: [timing[stage] for timing in timings] for stage in timings[0]}
    stages["total"] = [sum(timing.values()) for timing in timings]
    return Timing(
        stages_ms={stage: _spread(values) for stage, values in stages.items()},
        files_per_second=round(len(outcomes) / seconds, 3),
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
