"""STEP to GLB by OpenCascade."""

import re
import sys
from pathlib import Path

import cascadio

# Triangles may deviate by 1 % of the length of an edge, and by an angle in radians.
_DEVIATION, _ANGLE = 0.01, 0.5
# Names a file of the same folder, which the library would open.
_REFERENCE = re.compile(rb"\b(?:DOCUMENT_FILE|EXTERNALLY_DEFINED_\w+)\s*\(", re.IGNORECASE)


def read(path: Path) -> bytes:
    """A GLB of all solids and shells."""
    data = path.read_bytes()
    if _REFERENCE.search(data):
        sys.exit("the file refers to parts in other files; export it as one")
    if b"END-ISO-10303-21" not in data:  # on which the library may hang
        sys.exit("the file is cut off before its end; export or upload it again")
    return cascadio.load(
        data,
        "step",
        tol_linear=_DEVIATION,
        tol_angular=_ANGLE,
        tol_relative=True,
        use_parallel=False,
    )
