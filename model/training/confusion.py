"""A confusion matrix as one picture, legible with a handful of classes and with a hundred."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from matplotlib.colors import PowerNorm
from matplotlib.figure import Figure
from numpy.typing import NDArray

CELL = 0.24
"""Inches of a cell: a line of the class names beside it, and three digits in it."""
DPI = 110
GREY = "0.85"


def draw_confusion(
    classes: Sequence[str],
    confusion: NDArray[np.intp],
    refused: NDArray[np.intp],
    path: Path,
) -> None:
    """Share of each class's files that got each answer, as PNG.

    classes: N_c names. confusion: N_c x N_c files by class (rows) and answer (columns). refused:
    N_c files without an answer; they are a last column, if there are any. The row of a class
    without files stays grey.
    """
    columns = [*classes, "(refused)"] if refused.any() else list(classes)
    counts = np.column_stack([confusion, refused])[:, : len(columns)]
    totals = counts.sum(axis=1, keepdims=True)
    shares = np.ma.masked_invalid(counts / np.where(totals, totals, np.nan))

    margin = 0.085 * max(map(len, columns)) + 1  # inches: the longest name, and the axis's own
    size = (max(len(columns) * CELL + margin, 4), len(classes) * CELL + margin)
    figure = Figure(figsize=size, layout="constrained")
    axes = figure.subplots()
    # The root: one file in fifty that goes astray is to be seen from afar.
    norm = PowerNorm(0.5, vmin=0, vmax=1)
    axes.pcolormesh(shares, cmap="Blues", norm=norm, edgecolors=GREY, linewidth=0.5)
    axes.set(xlabel="answer", ylabel="class", aspect="equal", facecolor=GREY)
    axes.set_title("% of the files of each class", fontsize=10)
    axes.invert_yaxis()
    plain = {"fontsize": 8, "parse_math": False}  # a name with two $ is no formula
    axes.set_xticks(np.arange(len(columns)) + 0.5, columns, rotation=90, **plain)
    axes.set_yticks(np.arange(len(classes)) + 0.5, list(classes), **plain)
    axes.tick_params(length=0)
    centred = {"ha": "center", "va": "center", "fontsize": 6.5}
    for row, column in zip(*np.nonzero(counts), strict=True):
        share = shares[row, column]
        color = "white" if share > 0.3 else "black"
        axes.text(column + 0.5, row + 0.5, f"{100 * share:.0f}", color=color, **centred)
    figure.savefig(path, dpi=DPI)
