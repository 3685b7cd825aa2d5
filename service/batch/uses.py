"""What is made of outcomes beside their records: files sorted into folders, a page of all."""

from collections.abc import Iterable, Iterator
from pathlib import Path

from meshconv3d.service.batch.classifying import Outcome
from meshconv3d.service.batch.sorting import SortedFolder
from meshconv3d.service.prediction import ModelId
from meshconv3d.service.records import Answer, Refusal, parse_record


class Uses:
    """Looks at outcomes on their way to the output."""

    def __init__(self, folder: Path | None, page: Path | None, model: ModelId, source: str) -> None:
        """folder: to sort into; page: of the report; None for neither. source: what is classified,
        in words of the user's."""
        self._folder = None if folder is None else SortedFolder(folder)
        self._report = None
        if page is not None:
            from meshconv3d.service.batch.report.collecting import Report
            from meshconv3d.service.batch.report.page import write_page

            self._report = Report(model, source)
            self._write = lambda report, seconds: write_page(report, page, seconds)

    def earlier(self, record: bytes) -> None:
        """Take the record of a file that an earlier run has sorted."""
        if self._report is not None:
            self._report.add(parse_record(record))

    def of(self, outcomes: Iterable[Outcome]) -> Iterator[Outcome]:
        """The same outcomes, each given on when its file is in its place: then a run that is killed
        and goes on leaves none out. Raises OSError."""
        if self._folder is None and self._report is None:
            yield from outcomes
            return
        for outcome in outcomes:
            record = parse_record(outcome.record)
            if self._folder is not None:
                _sort(self._folder, record, outcome)
            if self._report is not None:
                self._report.add(record, outcome.picture)
            yield outcome

    def close(self, seconds: float) -> None:
        """Write what can be written only now. seconds: how long it took. Raises OSError."""
        if self._report is not None:
            self._write(self._report, seconds)


def _sort(folder: SortedFolder, record: Answer | Refusal, outcome: Outcome) -> None:
    local = outcome.entry.local
    if local is not None:
        folder.place(record, local)
    elif outcome.sha256 is not None:  # what could not be read before is not read now
        folder.place(record, outcome.entry.read())
