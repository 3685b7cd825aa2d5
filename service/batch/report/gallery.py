"""The files that a report shows: a bounded part of all, and that the part worth looking at."""

import heapq
import itertools
from collections import defaultdict
from dataclasses import dataclass

from meshconv3d.service.records import Answer


@dataclass(frozen=True)
class Shown:
    """One classified file, as the page needs it. likeliest: the first classes, with their
    probabilities; milliseconds: of all stages; picture: PNG, or None for a file without."""

    file: str
    unknown: bool
    likeliest: list[tuple[str, float]]
    faces: int
    milliseconds: float
    picture: bytes | None

    @property
    def class_(self) -> str:
        """The likeliest class; of an unknown file, the nearest."""
        return self.likeliest[0][0]

    @property
    def probability(self) -> float:
        """That of the likeliest class."""
        return self.likeliest[0][1]


# Classes of a file that the page names.
LIKELIEST = 3


def shown(answer: Answer, picture: bytes | None) -> Shown:
    """What the page needs of an answer, and no more: a report holds thousands."""
    return Shown(
        answer.file or "-",
        bool(answer.unknown),
        [(score.class_, score.probability) for score in answer.scores[:LIKELIEST]],
        answer.mesh.faces_in,
        round(sum(answer.timings_ms.values()), 1),
        picture,
    )


class Gallery:
    """At most `most` files. What does not fit are the surest of the classes with most files, so
    that the doubtful ones and small classes stay; the unknown ones count as a class."""

    def __init__(self, most: int) -> None:
        self.most = most
        self._held = 0
        self._order = itertools.count()
        # By class, the surest first: (-probability, order of arrival, file).
        self._classes: dict[str | None, list[tuple[float, int, Shown]]] = defaultdict(list)

    def add(self, file: Shown) -> None:
        """Take a file, and let one go where that makes too many."""
        key = None if file.unknown else file.class_
        heapq.heappush(self._classes[key], (-file.probability, next(self._order), file))
        self._held += 1
        if self._held > self.most:
            heapq.heappop(max(self._classes.values(), key=len))
            self._held -= 1

    def least_certain_first(self) -> list[Shown]:
        """The files that are held."""
        held = (entry for files in self._classes.values() for entry in files)
        return [file for _, _, file in sorted(held, key=lambda entry: (-entry[0], entry[1]))]
