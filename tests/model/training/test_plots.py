"""The picture of a confusion matrix: what is drawn where, and that it stays legible."""

from pathlib import Path

import numpy as np
import pytest
from matplotlib.image import imread

from meshconv3d.model.training.plots import draw_confusion

COUNTS = np.array([[3, 1, 0], [0, 5, 0], [2, 0, 1]])
NONE = np.zeros(3, dtype=int)


def drawn(path: Path, counts=COUNTS, refused=NONE) -> np.ndarray:
    draw_confusion([f"class{i}" for i in range(len(counts))], counts, refused, path)
    return imread(path)


@pytest.mark.parametrize("classes", [1, 3, 69])
def test_every_class_has_room_for_its_name(tmp_path: Path, classes: int) -> None:
    height, width, _ = drawn(
        tmp_path / "a.png", np.eye(classes, dtype=int), np.zeros(classes, int)
    ).shape
    assert min(height, width) >= 20 * classes
    assert max(height, width) <= 30 * classes + 500


def test_rows_are_shares(tmp_path: Path) -> None:
    """Ten times the files of a class change nothing."""
    scaled = COUNTS * [[10], [1], [3]]
    assert (drawn(tmp_path / "a.png") == drawn(tmp_path / "b.png", scaled)).all()


def test_rows_are_truth_and_go_down(tmp_path: Path) -> None:
    """Answers that come after their class are above the diagonal, where it is dark then."""
    image = drawn(tmp_path / "a.png", np.triu(np.ones((20, 20), int)), np.zeros(20, int))
    height, width, _ = image.shape
    above, below = image[: height // 2, width // 2 :], image[height // 2 :, : width // 2]
    assert above[..., 0].mean() < below[..., 0].mean() - 0.1


def test_a_name_is_no_formula(tmp_path: Path) -> None:
    draw_confusion(["$a$", r"$\b$", "_$"], COUNTS, NONE, tmp_path / "a.png")


def test_refused_files_are_one_more_column(tmp_path: Path) -> None:
    cells = [
        drawn(tmp_path / "a.png", np.eye(20, dtype=int), refused).shape
        for refused in (np.zeros(20, int), np.eye(20, dtype=int)[3])
    ]
    assert cells[1][1] > cells[0][1]


def test_a_class_without_files_divides_by_nothing(tmp_path: Path) -> None:
    assert drawn(tmp_path / "a.png", COUNTS * [[1], [0], [1]]).any()
