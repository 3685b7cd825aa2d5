"""The learning curves of a run as one picture."""

from pathlib import Path
from typing import Any


def draw_curves(history: list[dict[str, Any]], path: Path) -> None:
    """Loss and accuracies over the epochs, as PNG. history: the records of `Trainer.run`."""
    from matplotlib.figure import Figure

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
    figure.savefig(path, dpi=120)
