"""From a folder of binary images to outlines."""

import re
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from PIL import Image
from scipy.ndimage import binary_fill_holes
from shapely import Polygon, get_coordinates
from shapely.geometry.base import BaseGeometry
from skimage.measure import find_contours

from benchmarks.cubes.recipe import CubesError

TOLERANCE = 0.001  # of the contour's length
FILE_NAME = re.compile(r"(.+)-(\d+)\.gif", re.IGNORECASE)


@dataclass(frozen=True)
class Silhouette:
    """One image; its file is called CLASS-NUMBER.gif."""

    path: Path
    label: str
    number: int

    @property
    def name(self) -> str:
        return f"{self.label}-{self.number:02d}"


def find_silhouettes(
    folder: Path, classes: Sequence[str], count: int
) -> dict[str, list[Silhouette]]:
    """The silhouettes of every class by number, from anywhere under `folder`.

    Raises CubesError where a class has another count, or two files the same class and number.
    """
    found: dict[str, dict[int, Silhouette]] = {label: {} for label in classes}
    for path in sorted(folder.rglob("*")):
        match = FILE_NAME.fullmatch(path.name)
        if match is None or match[1] not in found:
            continue
        one = Silhouette(path, match[1], int(match[2]))
        other = found[one.label].setdefault(one.number, one)
        if other is not one:
            raise CubesError(f"two files for silhouette {one.name}: {other.path}, {path}")
    wrong = [f"{label} ({len(of)})" for label, of in found.items() if len(of) != count]
    if wrong:
        raise CubesError(
            f"expected {count} silhouettes CLASS-NUMBER.gif of each class under {folder}, not so: "
            + ", ".join(wrong)
        )
    return {label: [of[number] for number in sorted(of)] for label, of in found.items()}


def outline(path: Path, most_corners: int) -> NDArray[np.float64]:
    """The corners, N x 2, of the longest outer contour of an image, white on black.

    Simplified to TOLERANCE, or as much more as `most_corners` demands; counter-clockwise, y
    upwards, with a long side of 1 and the middle of its box at the origin. It does not cross
    itself. Raises CubesError.
    """
    # The margin closes contours at the image's edge. Without holes, all contours are outer ones.
    filled = np.asarray(binary_fill_holes(np.pad(_white(path), 1)), float)
    contours = find_contours(filled, 0.5, fully_connected="high")
    if not contours:
        raise CubesError(f"{path} holds no silhouette: none of its pixels is white")
    rings = [Polygon(contour[:, ::-1] * (1, -1)) for contour in contours]
    return _unit(_simplified(max(rings, key=lambda ring: ring.length), most_corners))


def _white(path: Path) -> NDArray[np.bool_]:
    """H x W, which pixels of a binary image are white."""
    try:
        with Image.open(path) as image:
            return np.asarray(image.convert("L")) > 127
    except (OSError, SyntaxError, ValueError, EOFError, Image.DecompressionBombError) as error:
        raise CubesError(f"{path} cannot be read as an image: {error}") from None


def _simplified(ring: Polygon, most_corners: int) -> NDArray[np.float64]:
    tolerance = TOLERANCE * ring.length
    while len(corners := _corners(ring.simplify(tolerance))) > most_corners:
        tolerance *= 1.1
    return corners


def _corners(ring: BaseGeometry) -> NDArray[np.float64]:
    """Counter-clockwise, each once: normalized, a ring is clockwise, with its start repeated."""
    return get_coordinates(ring.normalize())[:0:-1]


def _unit(corners: NDArray[np.float64]) -> NDArray[np.float64]:
    low, high = corners.min(axis=0), corners.max(axis=0)
    return (corners - (low + high) / 2) / (high - low).max()
