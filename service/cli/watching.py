"""How far `classify` has come: a line on standard error, where a person can see it."""

import threading
import time
from collections.abc import Iterable, Iterator
from contextlib import contextmanager, nullcontext, suppress

from rich.console import Console
from rich.progress import (
    BarColumn,
    MofNCompleteColumn,
    Progress,
    SpinnerColumn,
    TaskID,
    TextColumn,
    TimeRemainingColumn,
)

from meshconv3d.service.batch.classifying import Outcome
from meshconv3d.service.batch.listing import Listing
from meshconv3d.service.batch.summary import Tally
from meshconv3d.service.cli.sinks import Sink


class Watch:
    """Shows how many files are done, how fast, how many were refused and why, and once all were
    counted, the time that is left. shown: only at a terminal, and for more than one file."""

    def __init__(self, listing: Listing, shown: bool) -> None:
        """shown: whether nothing else writes to the terminal meanwhile."""
        console = Console(stderr=True)
        self.shown = shown and console.is_terminal and len(listing.first(2)) > 1
        self._listing = listing
        self._progress = Progress(
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
        self._started = time.monotonic()

    def follow(self, outcomes: Iterable[Outcome], sink: Sink) -> None:
        """Hand all outcomes to the sink, and show it."""
        self._started = time.monotonic()
        with self._progress if self.shown else nullcontext():
            task = self._progress.add_task("starting", total=None)
            if self.shown:
                threading.Thread(target=self._count, args=(task,), daemon=True).start()
            for outcome in outcomes:
                sink.add(outcome)
                if self.shown:
                    tally = sink.tally
                    self._progress.update(
                        task, completed=tally.files, description=self._rate_and_refusals(tally)
                    )

    @property
    def seconds(self) -> float:
        """How long it has taken so far."""
        return time.monotonic() - self._started

    @contextmanager
    def paused(self) -> Iterator[None]:
        """Within this, the terminal is another's."""
        if not self._progress.live.is_started:  # started again after the end, it would stay
            yield
            return
        self._progress.stop()
        yield
        self._progress.start()

    def summary(self, tally: Tally) -> str:
        """All in one line."""
        text = f"{tally.files} files: {tally.classified} classified"
        if tally.refused:
            text += f", {tally.refused.total()} refused ({tally.reasons()})"
        if tally.earlier:
            text += f", {tally.earlier} of them earlier"
        return f"{text}; {self._rate(tally)}" if tally.files > tally.earlier else text

    def _count(self, task: TaskID) -> None:
        # Beside the work: to list files takes a fraction of the time to classify them.
        with suppress(OSError):  # which the work itself meets, and tells
            self._progress.update(task, total=sum(1 for _ in self._listing))

    def _rate_and_refusals(self, tally: Tally) -> str:
        refused = f", refused: {tally.reasons()}" if tally.refused else ""
        return self._rate(tally) + refused

    def _rate(self, tally: Tally) -> str:
        return f"{(tally.files - tally.earlier) / max(self.seconds, 1e-3):.1f} files/s"
