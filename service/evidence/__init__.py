"""Why a mesh has its score: the mesh as uploaded, coloured by what each face adds.

`explanation` finds the numbers, `colours` makes colours of them, `records` says what both mean,
`glb` and `ply` write the mesh, and `forms` lists all forms in which an explanation leaves.
"""

from meshconv3d.service.evidence.explanation import (
    Explanation,
    NotExplained,
    explain,
    explained_class,
)
from meshconv3d.service.evidence.forms import FORMS, Form

__all__ = ["FORMS", "Explanation", "Form", "NotExplained", "explain", "explained_class"]
