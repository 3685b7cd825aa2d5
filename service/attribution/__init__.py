"""Attribution: the score of a class, distributed over the faces of the mesh as uploaded.

`explanation` finds the contribution of each face, `colours` maps contributions to colours, `legend`
describes both, and `meshes` writes the coloured mesh as GLB or PLY.
"""

from collections.abc import Callable
from dataclasses import dataclass

from meshconv3d.model.loading import FORMATS
from meshconv3d.service.attribution.explanation import (
    Explanation,
    NotExplained,
    explain,
    explained_class,
)
from meshconv3d.service.attribution.legend import explained_answer
from meshconv3d.service.attribution.meshes import to_glb, to_ply
from meshconv3d.service.records import to_json

__all__ = ["FORMS", "Explanation", "Form", "NotExplained", "explain", "explained_class"]


@dataclass(frozen=True)
class Form:
    """File form of an explanation. media_type: as HTTP names it. write: makes its bytes of the
    file's name, or None, and the explanation."""

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
