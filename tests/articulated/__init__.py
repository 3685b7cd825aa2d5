"""Meshes to test with: one articulated thing of each of ten classes of SHREC11.

They are no part of that data set, which may not be passed on: `benchmarks.samples` builds them from
limbs, balls and boxes. Their formats and face counts differ, so that together they use every reader
of a common format and every kind of preparation.
"""

from pathlib import Path

from meshconv3d.model.loading import FORMATS


def sample_paths() -> dict[str, Path]:
    """The file of each mesh by its class, sorted by class."""
    files = Path(__file__).parent.iterdir()
    return {path.stem: path for path in sorted(files) if path.suffix[1:] in FORMATS}
