"""Silhouettes drawn for the tests, named as the real ones are."""

import tarfile
from pathlib import Path

import numpy as np
import pytest
from PIL import Image, ImageDraw

from benchmarks.cubes.recipe import Recipe
from tests.conftest import SHARED_DATA

SMALL = Recipe(classes=("Moon", "star"), train=3, test=1, copies=2)


@pytest.fixture
def recipe() -> Recipe:
    """Two classes of four silhouettes, two cubes of each."""
    return SMALL


@pytest.fixture
def silhouettes(tmp_path: Path) -> Path:
    """Folder with the silhouettes of `recipe`, and others: moons in a folder of their own."""
    folder = tmp_path / "silhouettes"
    (folder / "Moon").mkdir(parents=True)
    for number in range(1, 5):
        moon = Image.new("1", (90, 70))
        pen = ImageDraw.Draw(moon)
        pen.ellipse((10, 5, 70, 65), fill=1)
        pen.ellipse((20 + 5 * number, 10, 80, 60), fill=0)
        moon.save(folder / "Moon" / f"Moon-{number:02d}.gif")
        star = Image.new("1", (80, 80))
        angles = np.arange(2 * (number + 3)) * np.pi / (number + 3)
        radii = np.where(np.arange(len(angles)) % 2, 15, 38)
        points = 40 + np.stack([radii * np.cos(angles), radii * np.sin(angles)], 1)
        ImageDraw.Draw(star).polygon([tuple(point) for point in points.tolist()], fill=1)
        star.save(folder / f"star-{number}.gif")
        star.save(folder / f"device{number}-1.gif")
    (folder / "notes.txt").write_text("not an image")
    return folder


@pytest.fixture(scope="session")
def mpeg7(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Folder of the real silhouettes; skips where they are not at hand."""
    archive = SHARED_DATA / "mpeg7_ce_shape1_B.tar.xz"
    if not archive.is_file():
        pytest.skip("needs the MPEG-7 silhouettes, which a clone does not have")
    folder = tmp_path_factory.mktemp("mpeg7")
    with tarfile.open(archive) as tar:
        tar.extractall(folder, filter="data")
    return folder
