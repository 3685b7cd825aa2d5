"""The one form in which an evaluation leaves: what stands in a terminal's tables, and as JSON."""

from pydantic import BaseModel, Field

from meshconv3d.model.metrics import CALIBRATION_BINS
from meshconv3d.service.prediction import ModelId


class DataId(BaseModel):
    """Which files were classified: one part of a labelled folder."""

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
    """How good a model is. Refused files count as wrong in each accuracy.

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
