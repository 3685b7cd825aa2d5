"""Output for a person: text that is safe to print, tables of results, progress."""

import threading
import time
from contextlib import suppress
from typing import Self

import click
from rich.console import Console
from rich.markup import escape
from rich.progress import (
    BarColumn,
    MofNCompleteColumn,
    SpinnerColumn,
    TaskID,
    TextColumn,
    TimeRemainingColumn,
)
from rich.progress import Progress as Bar
from rich.table import Table

from meshconv3d.service.batch.listing import Listing
from meshconv3d.service.batch.running import Tally
from meshconv3d.service.prediction import Failure, Result
from meshconv3d.service.records import record, to_json

# The class and its runner-up: with more, the table outgrows a terminal of 80 columns.
TABLE_TOP = 2


def printable(text: str) -> str:
    """Text without control characters, which could command the terminal."""
    return "".join(char if char.isprintable() else "\ufffd" for char in text)


def shown(text: str) -> str:
    """Printable text without markup, for rich."""
    return escape(printable(text))


class Progress:
    """Line on standard error with the files done, their rate, refusals by fault and, once all files
    were counted, the remaining time. Only at a terminal, and for more than one file.

    tally: counts of what is done, to which the caller adds. shown: whether there is the line.
    """

    def __init__(self, listing: Listing, tally: Tally, quiet: bool = False) -> None:
        """quiet: something else writes to the terminal all the time."""
        console = Console(stderr=True)
        self.tally = tally
        self.shown = not quiet and console.is_terminal and len(listing.first(2)) > 1
        self._listing = listing
        self._bar = Bar(
            SpinnerColumn("line"),  # in ASCII
            BarColumn(),
            MofNCompleteColumn(),
            TextColumn("{task.description}"),
            TimeRemainingColumn(),
            console=console,
            transient=True,
            refresh_per_second=4,
            redirect_stdout=False,
        )
        self._task = self._bar.add_task("starting", total=None)
        self._started = time.monotonic()

    def __enter__(self) -> Self:
        self._started = time.monotonic()
        if self.shown:
            self._bar.start()
            threading.Thread(target=self._count, args=(self._task,), daemon=True).start()
        return self

    def __exit__(self, *_: object) -> None:
        if self.shown:
            self._bar.stop()

    def update(self) -> None:
        """Show what the tally has now."""
        if self.shown:
            refused = f", refused: {self.tally.reasons()}" if self.tally.refused else ""
            description = self._rate() + refused
            self._bar.update(self._task, completed=self.tally.files, description=description)

    @property
    def seconds(self) -> float:
        """Seconds since the start."""
        return time.monotonic() - self._started

    def summary(self) -> str:
        """All in one line."""
        tally = self.tally
        text = f"{tally.files} file{'s' * (tally.files != 1)}: {tally.classified} classified"
        if tally.refused:
            text += f", {tally.refused.total()} refused ({tally.reasons()})"
        if tally.earlier:
            text += f", {tally.earlier} of them earlier"
        return f"{text}; {self._rate()}" if tally.files > tally.earlier else text

    def _rate(self) -> str:
        done = self.tally.files - self.tally.earlier
        return f"{done / max(self.seconds, 1e-3):.1f} files/s"

    def _count(self, task: TaskID) -> None:
        # Beside the work: to list files takes a fraction of the time to classify them.
        with suppress(OSError):  # which the work itself meets, and tells
            self._bar.update(task, total=sum(1 for _ in self._listing))


class Printer:
    """Prints results on standard output: as JSON Lines, as they come.

    top: number of classes of each, or None for all.
    """

    def __init__(self, top: int | None) -> None:
        self._top = top

    def add(self, name: str, result: Result) -> None:
        """Take the result of the file of this name."""
        click.echo(to_json(record(name, result, self._top)))

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        """Print what is left; also after an error."""


class TablePrinter(Printer):
    """Prints a table for a person at the end, with the reasons of refusals below."""

    def __init__(self, top: int | None) -> None:
        super().__init__(TABLE_TOP if top is None else top)
        self._refusals: list[str] = []
        self._rough = False
        self._table = Table(box=None, pad_edge=False)
        self._table.add_column("File", overflow="fold")
        self._table.add_column("Class")
        self._table.add_column("Probability", justify="right")
        self._table.add_column("Next")
        self._table.add_column("Faces", no_wrap=True)

    def add(self, name: str, result: Result) -> None:
        self._table.add_row(shown(name), *_cells(result, self._top))
        if isinstance(result, Failure):  # below: a sentence in a column would squeeze all others
            self._refusals.append(f"[red]{shown(name)}: {shown(result.message)}[/red]")
        elif result.unknown is None:
            self._rough = True

    def __exit__(self, *_: object) -> None:
        console = Console(highlight=False)
        if self._table.row_count:
            console.print(self._table)
        for line in self._refusals:
            console.print(line, soft_wrap=True)
        if self._rough:
            console.print("[yellow]Probabilities are rough: the model has no calibration.[/yellow]")


def _cells(result: Result, top: int | None) -> list[str]:
    if isinstance(result, Failure):
        return [f"[red]{shown(result.fault)}[/red]"]
    before, after = result.report.faces_in, result.report.faces_used
    faces = f"{before}" if before == after else f"{before} → {after}"
    if result.unknown:
        return ["[yellow]unknown[/yellow]", "", f"nearest {shown(result.label)}", faces]
    others = (f"{shown(name)} {share:.1%}" for name, share, _ in result.top(top)[1:])
    label, probability = f"[bold]{shown(result.label)}[/bold]", f"{result.probability:.1%}"
    return [label, probability, ", ".join(others), faces]
