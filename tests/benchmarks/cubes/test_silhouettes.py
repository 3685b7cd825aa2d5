"""From images to outlines."""

from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from benchmarks.cubes.recipe import CubesError
from benchmarks.cubes.silhouettes import find_silhouettes, outline

MANY = 10_000


def image(folder: Path, pixels: np.ndarray) -> Path:
    """A black-and-white GIF of these pixels, H x W."""
    path = folder / "one-1.gif"
    Image.fromarray(np.where(pixels, 255, 0).astype(np.uint8)).save(path)
    return path


def area(corners: np.ndarray) -> float:
    """Positive where the corners run counter-clockwise."""
    x, y = corners.T
    return float(x @ np.roll(y, -1) - y @ np.roll(x, -1)) / 2


def test_an_outline_is_centred_with_a_long_side_of_one(tmp_path):
    pixels = np.zeros((200, 300), bool)
    pixels[20:70, 100:200] = True
    corners = outline(image(tmp_path, pixels), MANY)
    assert np.allclose([corners.min(0), corners.max(0)], [[-0.5, -0.25], [0.5, 0.25]])
    assert area(corners) == pytest.approx(0.5, rel=0.01)


def test_an_outline_is_not_mirrored(tmp_path):
    pixels = np.zeros((100, 100), bool)
    pixels[10:90, 10:30] = pixels[70:90, 10:90] = True
    corners = outline(image(tmp_path, pixels), MANY)
    assert np.abs(corners - (-0.5, 0.5)).sum(1).min() < 0.02
    assert np.abs(corners - (0.5, -0.5)).sum(1).min() < 0.02
    assert np.abs(corners - (0.5, 0.5)).sum(1).min() > 0.5


def test_only_the_longest_outer_contour_counts(tmp_path):
    pixels = np.zeros((100, 100), bool)
    pixels[10:60, 10:60] = True
    without = outline(image(tmp_path, pixels), MANY)
    pixels[12:58:2, 12:58] = False  # holes, together far longer than what is around them
    pixels[80:90, 80:90] = True
    assert np.array_equal(outline(image(tmp_path, pixels), MANY), without)


def test_a_silhouette_may_fill_its_image(tmp_path):
    corners = outline(image(tmp_path, np.ones((50, 100), bool)), MANY)
    assert area(corners) == pytest.approx(0.5, rel=0.01)


def test_an_outline_is_simplified_to_a_share_of_its_length_or_to_fewer_corners(tmp_path):
    y, x = np.mgrid[:400, :400] - 200
    path = image(tmp_path, x**2 + y**2 < 180**2)
    simple = outline(path, MANY)
    assert 20 < len(simple) < 60
    assert np.hypot(*simple.T) == pytest.approx(0.5, abs=0.005)
    assert len(outline(path, 12)) <= 12


def test_silhouettes_are_found_in_any_folder_and_sorted_by_number(silhouettes):
    (silhouettes / "star-4.gif").rename(silhouettes / "star-10.GIF")
    found = find_silhouettes(silhouettes, ("Moon", "star"), 4)
    assert [one.name for one in found["star"]] == ["star-01", "star-02", "star-03", "star-10"]
    assert [one.path.name for one in found["Moon"]][:2] == ["Moon-01.gif", "Moon-02.gif"]


def test_classes_without_their_silhouettes_are_named(silhouettes):
    (silhouettes / "star-2.gif").unlink()
    with pytest.raises(CubesError, match=r"expected 4 .*CLASS-NUMBER.*star \(3\), sun \(0\)$"):
        find_silhouettes(silhouettes, ("Moon", "star", "sun"), 4)


def test_a_silhouette_has_one_file(silhouettes):
    (silhouettes / "star-02.gif").write_bytes((silhouettes / "star-2.gif").read_bytes())
    with pytest.raises(CubesError, match=r"two files for silhouette star-02: .*gif, .*gif"):
        find_silhouettes(silhouettes, ("Moon", "star"), 4)


def test_what_cannot_be_read_is_refused(tmp_path):
    path = image(tmp_path, np.ones((50, 50), bool))
    whole = path.read_bytes()
    for content in (b"", b"GIF89a", whole[: len(whole) // 2], b"not an image"):
        path.write_bytes(content)
        with pytest.raises(CubesError, match=r"one-1\.gif cannot be read as an image"):
            outline(path, MANY)


def test_an_image_without_white_holds_no_silhouette(tmp_path):
    path = image(tmp_path, np.zeros((50, 50), bool))
    with pytest.raises(CubesError, match=r"one-1\.gif holds no silhouette"):
        outline(path, MANY)
