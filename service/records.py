"""The one form in which results leave: the lines of the command line, the answers over HTTP."""

import os

import numpy as np
from pydantic import AliasChoices, BaseModel, Field, TypeAdapter

from meshconv3d.model.errors import MeshError
from meshconv3d.model.preparation import MeshReport
from meshconv3d.service.classifier import Classification

# A word of Python in the records, with another name in here.
CLASS = AliasChoices("class", "class_")


class ClassScore(BaseModel):
    """One class with its calibrated probability and its raw score."""

    class_: str = Field(validation_alias=CLASS, serialization_alias="class", examples=["snake"])
    probability: float = Field(examples=[0.93])
    score: float = Field(description="logit", examples=[6.1])


class ModelId(BaseModel):
    """Which model answered: its name and the SHA-256 of its file."""

    name: str = Field(examples=["shrec11"])
    sha256: str


class Answer(BaseModel):
    """What one mesh is."""

    file: str | None = Field(description="name as given, if any", examples=["snake.obj"])
    class_: str = Field(validation_alias=CLASS, serialization_alias="class", examples=["snake"])
    probability: float = Field(examples=[0.93], description="calibrated on validation meshes")
    unknown: bool | None = Field(
        examples=[False],
        description="true: unlike every class of the model; then `class` is only the nearest. "
        "null: the model has no limit for it",
    )
    novelty: float = Field(
        examples=[-3.1], description="how unlike every class; the model's card has the limit"
    )
    scores: list[ClassScore] = Field(description="likeliest first")
    model: ModelId
    mesh: MeshReport = Field(description="what preparation found and did")
    timings_ms: dict[str, float] = Field(
        examples=[{"read": 0.9, "prepare": 1.1, "topology": 0.5, "infer": 1.4}]
    )


class Reason(BaseModel):
    """Why a file has no answer: a stable slug for programs and a message for people."""

    fault: str
    message: str


class Refusal(BaseModel):
    """A file that could not be classified, in the place of its answer."""

    file: str | None
    error: Reason


_SCORES = TypeAdapter(list[ClassScore])
_RECORD: TypeAdapter[Answer | Refusal] = TypeAdapter(Answer | Refusal)


def parse_record(content: bytes) -> Answer | Refusal:
    """A record that left as JSON. Raises ValueError for anything else."""
    return _RECORD.validate_json(content)


def answer(file: str | None, result: Classification, top: int | None = None) -> Answer:
    """The record of a result, with the `top` likeliest classes, or all."""
    # At once: rounded and checked one by one, they would be most of what a record takes.
    probabilities = result.probabilities.round(6).tolist()
    logits = result.scores.astype(np.float64).round(5).tolist()
    scores = _SCORES.validate_python(
        [
            {"class": result.classes[i], "probability": probabilities[i], "score": logits[i]}
            for i in result.ranking[:top]
        ]
    )
    return Answer(
        file=file,
        class_=scores[0].class_,
        probability=scores[0].probability,
        unknown=result.unknown,
        novelty=round(result.novelty, 4),
        scores=scores,
        model=model_id(result),
        mesh=result.report,
        timings_ms=result.timings_ms,
    )


def model_id(result: Classification) -> ModelId:
    """Which model gave a result."""
    return ModelId(name=result.model.card.name, sha256=result.model.sha256)


def readable(file: str) -> str:
    """A file name as text; bytes that are no UTF-8, which JSON cannot hold, are replaced."""
    return os.fsencode(file).decode(errors="replace")


def refusal(file: str | None, error: MeshError | OSError) -> Refusal:
    """The record of a file that cannot be read or is no mesh."""
    if isinstance(error, MeshError):
        return Refusal(file=file, error=Reason(fault=error.fault, message=str(error)))
    reason = Reason(fault="unreadable", message=f"cannot be opened: {error.strerror}")
    return Refusal(file=file, error=reason)
