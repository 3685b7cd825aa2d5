"""The mesh files of a folder."""

import logging
import os
from pathlib import Path

from model.loading.formats import FORMATS

log = logging.getLogger(__name__)


def find_meshes(folder: Path) -> list[Path]:
    """Every file under `folder` whose extension is one that is read, sorted by path.

    A subfolder that cannot be listed is logged and passed over.
    """
    walk = os.walk(folder, onerror=lambda error: log.warning("passed over: %s", error))
    files = (Path(place, name) for place, _, names in walk for name in names)
    return sorted(file for file in files if file.suffix.lower().lstrip(".") in FORMATS)
