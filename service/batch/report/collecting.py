"""What a report keeps of a batch while it runs: counts of all, and a bounded part to be shown."""

import heapq
import itertools
from collections import Counter
from dataclasses import dataclass, field

from meshconv3d.service.batch.report.gallery import Gallery, shown
from meshconv3d.service.prediction import ModelId
from meshconv3d.service.records import Answer, Refusal

# With a picture each, these make a page of 16 MB; see docs/batch-report.md.
MOST_SHOWN = 10_000

# Refused files of one fault that are named; the rest is counted.
MOST_NAMED = 500

SLOWEST = 20

# Bars of the histogram, each 5 % wide.
BINS = 20


@dataclass
class Fault:
    """Files that were refused for one reason. named: the first of them."""

    files: int = 0
    named: list[Refusal] = field(default_factory=list)


class Report:
    """What a batch came to, taken one record after the other.

    Holds the counts of all files, up to `most_shown` classified ones with their pictures,
    MOST_NAMED refused ones for each fault, and the SLOWEST: some 20 MB, however many there are.
    """

    def __init__(self, model: ModelId, source: str, most_shown: int = MOST_SHOWN) -> None:
        """source: what was classified, in words of the user's, such as the folders."""
        self.model = model
        self.source = source
        self.unknown = 0
        self.classes: Counter[str] = Counter()  # without the unknown files
        self.histogram = [0] * BINS  # of these files, by probability
        self.faults: dict[str, Fault] = {}
        self.gallery = Gallery(most_shown)
        self._order = itertools.count()
        self._slowest: list[tuple[float, int, str, dict[str, float]]] = []

    def add(self, record: Answer | Refusal, picture: bytes | None = None) -> None:
        """Take the record of one file, and its picture where there is one (`service.picture`)."""
        if isinstance(record, Refusal):
            self._refuse(record)
            return
        if record.unknown:
            self.unknown += 1
        else:
            self.classes[record.class_] += 1
            self.histogram[min(int(record.probability * BINS), BINS - 1)] += 1
        self.gallery.add(shown(record, picture))
        self._time(record)

    @property
    def classified(self) -> int:
        """Files with a class that is not only the nearest."""
        return self.classes.total()

    @property
    def refused(self) -> int:
        """Files without an answer."""
        return sum(fault.files for fault in self.faults.values())

    @property
    def files(self) -> int:
        """All."""
        return self.classified + self.unknown + self.refused

    @property
    def slowest(self) -> list[tuple[str, dict[str, float]]]:
        """The files that took longest, slowest first, with their timings_ms."""
        return [(file, timings) for _, _, file, timings in sorted(self._slowest, reverse=True)]

    def _refuse(self, record: Refusal) -> None:
        fault = self.faults.setdefault(record.error.fault, Fault())
        fault.files += 1
        if len(fault.named) < MOST_NAMED:
            fault.named.append(record)

    def _time(self, record: Answer) -> None:
        timings = record.timings_ms
        entry = (sum(timings.values()), next(self._order), record.file or "-", timings)
        heapq.heappush(self._slowest, entry)
        if len(self._slowest) > SLOWEST:
            heapq.heappop(self._slowest)
