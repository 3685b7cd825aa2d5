"""Records of a batch that never ran."""

from meshconv3d.model.preparation import MeshReport
from meshconv3d.service.records import Answer, ClassScore, ModelId, Reason, Refusal

MODEL = ModelId(name="toys", sha256="0123456789abcdef" * 4)

MESH = MeshReport(
    faces_in=1200,
    faces_used=500,
    vertices_in=602,
    vertices_merged=0,
    degenerate_dropped=0,
    duplicates_dropped=0,
    nonmanifold_edges=0,
    vertices_split=0,
    flipped=0,
    components=1,
    border_edges=0,
    watertight=True,
    resampled="decimated",
    within_budget=True,
    components_lost=0,
    area_kept=1.0,
)


def answer(
    file: str,
    label: str = "ring",
    probability: float = 0.9,
    unknown: bool | None = False,
    milliseconds: float = 4.0,
) -> Answer:
    """What a file is, with a second class for the rest of the probability."""
    scores = [(label, probability), ("something else", 1 - probability)]
    return Answer(
        file=file,
        class_=label,
        probability=probability,
        unknown=unknown,
        novelty=0.0,
        scores=[ClassScore(class_=name, probability=p, score=p) for name, p in scores],
        model=MODEL,
        mesh=MESH,
        timings_ms={"read": 1.0, "prepare": milliseconds - 1.0},
    )


def refusal(file: str, fault: str = "no-faces", message: str = "it holds no triangles") -> Refusal:
    return Refusal(file=file, error=Reason(fault=fault, message=message))
