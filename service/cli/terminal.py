"""Output for a person: text that is safe to print, tables of results, progress."""

import threading
import time
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager, nullcontext, suppress
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

# Rows that are printed as one table: columns can be measured only once all rows are there.
PAGE = 1000
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

    @contextmanager
    def paused(self) -> Iterator[None]:
        """Within it, something else may write to the terminal."""
        if not self._bar.live.is_started:  # started again after the end, it would stay
            yield
            return
        self._bar.stop()
        yield
        self._bar.start()

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

    top: only so many classes of each, or all.
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
    """As tables for a person, each with the reasons of its refusals below."""

    def __init__(
        self, top: int | None, undisturbed: Callable[[], AbstractContextManager[None]] = nullcontext
    ) -> None:
        """undisturbed: nothing else writes to the terminal within it."""
        super().__init__(TABLE_TOP if top is None else top)
        self._undisturbed = undisturbed
        self._results: list[tuple[str, Result]] = []

    def add(self, name: str, result: Result) -> None:
        self._results.append((shown(name), result))
        if len(self._results) >= PAGE:
            self.__exit__()

    def __exit__(self, *_: object) -> None:
        if self._results:
            with self._undisturbed():
                _print_table(self._results, self._top)
        self._results = []


def _print_table(results: list[tuple[str, Result]], top: int | None) -> None:
    table = Table(box=None, pad_edge=False)
    table.add_column("File", overflow="fold")
    table.add_column("Class")
    table.add_column("Probability", justify="right")
    table.add_column("Next")
    table.add_column("Faces", no_wrap=True)
    for name, result in results:
        table.add_row(name, *_cells(result, top))
    console = Console(highlight=False)
    console.print(table)
    for name, result in results:  # below: a sentence in a column would squeeze all others
        if isinstance(result, Failure):
            console.print(f"[red]{name}: {shown(result.message)}[/red]", soft_wrap=True)


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
