"""Checkpoints of the shipped models: to train from, and to export anew."""

from pathlib import Path

import click


def shipped_checkpoints() -> dict[str, Path]:
    """The checkpoint of each shipped model by its name, sorted by name."""
    return {path.stem: path for path in sorted(Path(__file__).parent.glob("*.safetensors"))}


class CheckpointFile(click.Path):
    """An option's value: the name of a shipped model, or the path of a checkpoint."""

    name = "checkpoint"

    def __init__(self) -> None:
        super().__init__(exists=True, dir_okay=False, path_type=Path)

    def convert(self, value: object, param: object, ctx: object) -> Path:
        """The path of the file. Raises BadParameter, which names the shipped models."""
        shipped = shipped_checkpoints()
        try:
            return shipped.get(str(value)) or super().convert(value, param, ctx)  # type: ignore[arg-type]
        except click.BadParameter as error:
            error.message += f" Shipped models are {', '.join(shipped)}."
            raise
