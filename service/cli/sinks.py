"""Where `classify` puts its records, if not into a file."""

import json
from collections.abc import Callable, Collection
from contextlib import AbstractContextManager
from typing import Any, Protocol

import click
from rich.console import Console
from rich.table import Table

from meshconv3d.service.batch.classifying import Outcome
from meshconv3d.service.batch.summary import Tally
from meshconv3d.service.cli.terminal import shown

# Rows that are printed as one table: columns can be measured only once all rows are there.
PAGE = 1000


class Sink(Protocol):
    """Takes outcomes. tally: those that it has."""

    tally: Tally

    def done_as(self, name: str) -> Collection[str]:
        """See `DoneAs`."""
        ...

    def add(self, outcome: Outcome) -> None:
        """Take one."""
        ...

    def close(self) -> None:
        """Finish what was begun; also after an error."""
        ...


class Lines:
    """JSON Lines on standard output, as they come."""

    def __init__(self) -> None:
        self.tally = Tally()

    def done_as(self, name: str) -> Collection[str]:
        """See `Sink`."""
        return ()

    def add(self, outcome: Outcome) -> None:
        """See `Sink`."""
        self.tally.add(outcome.fault)
        click.echo(outcome.record)

    def close(self) -> None:
        """See `Sink`."""


class Tables:
    """Tables for people on standard output, each with the reasons of its refusals below."""

    def __init__(self, undisturbed: Callable[[], AbstractContextManager[None]]) -> None:
        """undisturbed: nothing else writes to the terminal within it."""
        self.tally = Tally()
        self._undisturbed = undisturbed
        self._records: list[dict[str, Any]] = []

    def done_as(self, name: str) -> Collection[str]:
        """See `Sink`."""
        return ()

    def add(self, outcome: Outcome) -> None:
        """See `Sink`."""
        self.tally.add(outcome.fault)
        self._records.append(json.loads(outcome.record))
        if len(self._records) >= PAGE:
            self.close()

    def close(self) -> None:
        """See `Sink`."""
        if self._records:
            with self._undisturbed():
                _print_table(self._records)
            self._records = []


def _print_table(records: list[dict[str, Any]]) -> None:
    table = Table(box=None, pad_edge=False)
    table.add_column("File", overflow="fold")
    table.add_column("Class")
    table.add_column("Probability", justify="right")
    table.add_column("Next")
    table.add_column("Faces", no_wrap=True)
    for record in records:
        table.add_row(shown(record["file"]), *_cells(record))
    console = Console(highlight=False)
    console.print(table)
    for record in records:  # below: a sentence in a column would squeeze all others
        if "error" in record:
            line = f"{shown(record['file'])}: {shown(record['error']['message'])}"
            console.print(f"[red]{line}[/red]", soft_wrap=True)


def _cells(record: dict[str, Any]) -> list[str]:
    if "error" in record:
        return [f"[red]{shown(record['error']['fault'])}[/red]"]
    faces = _faces(record["mesh"]["faces_in"], record["mesh"]["faces_used"])
    if record["unknown"]:
        return ["[yellow]unknown[/yellow]", "", f"nearest {shown(record['class'])}", faces]
    others = (f"{shown(one['class'])} {one['probability']:.1%}" for one in record["scores"][1:])
    label, probability = f"[bold]{shown(record['class'])}[/bold]", f"{record['probability']:.1%}"
    return [label, probability, ", ".join(others), faces]


def _faces(faces_in: int, faces_used: int) -> str:
    return f"{faces_in}" if faces_in == faces_used else f"{faces_in} → {faces_used}"
