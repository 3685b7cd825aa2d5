"""Legend of an explanation's colours, and its record in JSON."""

from pydantic import BaseModel, Field

from meshconv3d.service.attribution.colours import legend_colours
from meshconv3d.service.attribution.explanation import Explanation
from meshconv3d.service.prediction import ModelId
from meshconv3d.service.records import Answer, answer


class Legend(BaseModel):
    """Meaning of the colours of a mesh, for one class."""

    file: str | None
    class_: str = Field(serialization_alias="class", examples=["snake"])
    score: float = Field(description="logit of the class: the bias plus all contributions")
    bias: float = Field(description="what the class has without any face")
    limit: float = Field(
        description="density of the last colour; -limit is that of the first, and 0 of the middle"
    )
    colours: list[str] = Field(
        examples=[["#1f77b4", "#eeeeee", "#d65f00"]], description="even steps, as web colours"
    )
    model: ModelId


class Evidence(Legend):
    """Contribution of each face of the file to one class, in the order of its triangles."""

    contributions: list[float] = Field(description="what each face adds to the score")
    densities: list[float] = Field(
        description="contributions by area: the score less the bias, if all of the surface said "
        "what this face says; what the colours show"
    )


class ExplainedAnswer(Answer):
    """Record of a mesh that was classified, with what each face adds to the score of a class."""

    evidence: Evidence


def legend(file: str | None, explanation: Explanation) -> Legend:
    """The legend of an explanation; file: its name, or None."""
    return Legend(
        file=file,
        class_=explanation.label,
        score=explanation.score,
        bias=explanation.bias,
        limit=explanation.limit,
        colours=legend_colours(),
        model=explanation.prediction.model,
    )


def explained_answer(file: str | None, explanation: Explanation) -> ExplainedAnswer:
    """The record of an explanation; file: its name, or None."""
    evidence = Evidence(
        **dict(legend(file, explanation)),
        contributions=explanation.contributions.tolist(),
        densities=explanation.densities.tolist(),
    )
    return ExplainedAnswer(**dict(answer(file, explanation.prediction)), evidence=evidence)
