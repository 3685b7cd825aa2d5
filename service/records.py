"""Public records: the JSON of the command line and of HTTP, made of results at the edge."""

from pydantic import AliasChoices, BaseModel, Field

from meshconv3d.model.preparation import MeshReport
from meshconv3d.service.prediction import Failure, ModelId, Prediction, Result

# `class` is a keyword of Python.
CLASS = AliasChoices("class", "class_")


class ClassScore(BaseModel):
    """One class with its calibrated probability and its raw score."""

    class_: str = Field(validation_alias=CLASS, serialization_alias="class", examples=["snake"])
    probability: float = Field(examples=[0.93])
    score: float = Field(description="logit", examples=[6.1])


class Answer(BaseModel):
    """Record of a mesh that was classified."""

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


class EmbeddedAnswer(Answer):
    """Record of a mesh that was classified, with what finds meshes like it."""

    embedding: list[float] = Field(
        description="of unit length; the inner product of two of one space is their cosine"
    )
    space: str = Field(description="embeddings can be compared where it is the same")
    radius: float = Field(
        examples=[1.7], description="from centroid to farthest vertex, in the file's units"
    )
    chirality: list[float] = Field(description="the mirror image has it with the other sign")


class Refusal(BaseModel):
    """Record of a file that could not be classified."""

    file: str | None
    error: Failure


def record(file: str | None, result: Result, top: int | None = None) -> Answer | Refusal:
    """Record of a file's result, with the `top` likeliest classes, or all."""
    if isinstance(result, Failure):
        return Refusal(file=file, error=result)
    return answer(file, result, top)


def answer(file: str | None, prediction: Prediction, top: int | None = None) -> Answer:
    """Record of a prediction, with the `top` likeliest classes, or all."""
    scores = [
        ClassScore(
            class_=one.name, probability=round(one.probability, 6), score=round(one.score, 5)
        )
        for one in prediction.top(top)
    ]
    return Answer(
        file=file,
        class_=scores[0].class_,
        probability=scores[0].probability,
        unknown=prediction.unknown,
        novelty=round(prediction.novelty, 4),
        scores=scores,
        model=prediction.model,
        mesh=prediction.report,
        timings_ms=prediction.timings_ms,
    )


def embedded_answer(
    file: str | None, prediction: Prediction, top: int | None = None
) -> EmbeddedAnswer:
    """Record of a prediction, with what finds meshes like it."""
    return EmbeddedAnswer(
        **dict(answer(file, prediction, top)),
        embedding=[round(float(number), 6) for number in prediction.embedding],
        space=prediction.space,
        radius=prediction.radius,
        chirality=[round(float(number), 9) for number in prediction.chirality],
    )


def to_json(record: BaseModel) -> bytes:
    """JSON of a record, on one line."""
    return record.model_dump_json(by_alias=True).encode()


def readable(file: str) -> str:
    """A file name as text; bytes that are not UTF-8, which JSON cannot hold, are replaced."""
    # Of an archive's member, too, whose name the file system's encoding may lack.
    return file.encode(errors="surrogateescape").decode(errors="replace")
