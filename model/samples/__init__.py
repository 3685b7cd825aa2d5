"""Sample meshes: articulated things that a network trained on SHREC11 knows, one of each class.

They are no part of that data set, which may not be passed on: `python -m model.samples.make`
builds every one from limbs, balls and boxes (`shapes`, on `solids`). Formats and face counts
differ, so that together they go through every reader and every kind of preparation.
"""

from pathlib import Path

from meshconv3d.model.loading import FORMATS


def sample_paths() -> dict[str, Path]:
    """The file of each sample by its class, sorted by class."""
    files = Path(__file__).parent.iterdir()
    return {path.stem: path for path in sorted(files) if path.suffix[1:] in FORMATS}
