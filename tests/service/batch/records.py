"""Records of a batch that never ran."""

from meshconv3d.service.prediction import Failure, ModelId
from meshconv3d.service.records import Answer, ClassScore, Refusal
from tests.results import REPORT

# A record, and the hash of the file's content.
Added = tuple[Answer | Refusal, str | None]

MODEL = ModelId(name="toys", sha256="0123456789abcdef" * 4)


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
        mesh=REPORT,
        timings_ms={"read": 1.0, "prepare": milliseconds - 1.0},
    )


def refusal(file: str, fault: str = "no-faces", message: str = "it holds no triangles") -> Refusal:
    return Refusal(file=file, error=Failure(fault, message))


def added(name: str, fault: str | None = None, sha256: str | None = "0" * 64) -> Added:
    """What an output is given of a file: refused with a fault, answered without."""
    record = answer(name) if fault is None else refusal(name, fault, "no, \u201cwhy\u201d")
    return record, sha256
