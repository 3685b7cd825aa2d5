"""Sample meshes: ten everyday things, a mechanical part, and a thing of no class.

All are CC0, from the open data set (SOURCES.md); `benchmarks.open_data.samples` writes them, in
different formats.
"""

from pathlib import Path

from meshconv3d.model.loading import FORMATS


def sample_paths() -> dict[str, Path]:
    """The file of each sample by its name, sorted by name."""
    files = Path(__file__).parent.iterdir()
    return {path.stem: path for path in sorted(files) if path.suffix[1:] in FORMATS}
