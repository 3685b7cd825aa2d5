"""Pictures of training and evaluation: learning curves and the confusion matrix."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np
from matplotlib.colors import PowerNorm
from matplotlib.figure import Figure
from numpy.typing import NDArray

CELL = 0.24
"""Inches of a cell of the confusion matrix: the height of a class name, or three digits."""
DPI = 110
GREY = "0.85"


def draw_curves(history: list[dict[str, Any]], path: Path) -> None:
    """Loss and accuracies over the epochs, as PNG. history: the records of `Trainer.run`."""
    epochs = [record["epoch"] for record in history]
    figure = Figure(figsize=(9, 3.5), layout="constrained")
    loss, accuracy = figure.subplots(1, 2)
    loss.plot(epochs, [record["loss"] for record in history])
    loss.set(xlabel="epoch", ylabel="training loss", ylim=(0, None))
    for key, title in (("train_accuracy", "training"), ("val_accuracy", "validation")):
        if key in history[0]:
            accuracy.plot(epochs, [record[key] for record in history], label=title)
    accuracy.set(xlabel="epoch", ylabel="accuracy", ylim=(0, 1.02))
    accuracy.legend(loc="lower right")
    for axes in (loss, accuracy):
        axes.grid(alpha=0.3)
    figure.savefig(path, dpi=DPI)


def draw_confusion(
    classes: Sequence[str],
    confusion: NDArray[np.intp],
    refused: NDArray[np.intp],
    path: Path | BinaryIO,
) -> None:
    """Share of each class's files that got each answer, as PNG, for 2 to 100 classes.

    classes: N_c names. confusion: N_c x N_c files by class (rows) and answer (columns). refused:
    N_c files without an answer; they are a last column, if there are any. The row of a class
    without files stays grey.
    """
    columns = [*classes, "(refused)"] if refused.any() else list(classes)
    counts = np.column_stack([confusion, refused])[:, : len(columns)]
    totals = counts.sum(axis=1, keepdims=True)
    shares = np.ma.masked_invalid(counts / np.where(totals, totals, np.nan))

    margin = 0.085 * max(map(len, columns)) + 1  # inches: the longest name and the axis label
    size = (max(len(columns) * CELL + margin, 4), len(classes) * CELL + margin)
    figure = Figure(figsize=size, layout="constrained")
    axes = figure.subplots()
    # The square root keeps shares of a few per cent visible.
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
    figure.savefig(path, dpi=DPI, format="png")
