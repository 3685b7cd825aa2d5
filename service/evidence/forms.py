"""The forms in which an explanation leaves: a coloured mesh, or its numbers."""

from collections.abc import Callable
from dataclasses import dataclass

from meshconv3d.model.loading import FORMATS
from meshconv3d.service.evidence.explanation import Explanation
from meshconv3d.service.evidence.glb import to_glb
from meshconv3d.service.evidence.ply import to_ply
from meshconv3d.service.evidence.records import explained_answer
from meshconv3d.service.records import to_json


@dataclass(frozen=True)
class Form:
    """One form. media_type: as HTTP names it. write: makes its bytes of the file's name, if it
    has one, and the explanation."""

    media_type: str
    write: Callable[[str | None, Explanation], bytes]


def _to_json(file: str | None, explanation: Explanation) -> bytes:
    return to_json(explained_answer(file, explanation))


# By file extension; the first is the default.
FORMS: dict[str, Form] = {
    "glb": Form(FORMATS["glb"].media_types[0], to_glb),
    "ply": Form(FORMATS["ply"].media_types[0], to_ply),
    "json": Form("application/json", _to_json),
}
