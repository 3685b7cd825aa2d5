"""Atomic writing of files."""

import os
from pathlib import Path


def write_whole(path: Path, content: bytes) -> None:
    """Write atomically: an interruption or a full disk leaves the old file or the new one.

    Raises OSError.
    """
    partial = path.with_name(path.name + ".partial")
    try:
        partial.write_bytes(content)
        os.replace(partial, path)
    except BaseException:
        partial.unlink(missing_ok=True)
        raise
