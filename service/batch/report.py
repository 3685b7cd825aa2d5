"""Report of a batch: one HTML page that needs no server, network or other file.

`Report` collects the records and keeps a bounded part of them; `write_page` renders `templates/`.
Needs the extra `report`; `service.picture` draws the meshes.
"""

import base64
import hashlib
import heapq
import itertools
from collections import Counter, defaultdict
from collections.abc import Sequence
from dataclasses import dataclass, field
from datetime import datetime
from pathlib import Path
from typing import Any

import numpy as np
from jinja2 import Environment, FileSystemLoader, StrictUndefined
from markupsafe import Markup
from numpy.typing import NDArray

from meshconv3d.model.files import replacing
from meshconv3d.service.prediction import ModelId
from meshconv3d.service.records import Answer, Refusal

# With a picture each, these make a page of 16 MB; see docs/batch-report.md.
MOST_SHOWN = 10_000
# Refused files of one fault that are named; the rest is counted.
MOST_NAMED = 500
# Slowest files that are named.
SLOWEST = 20
# Bars of the histogram, each 5 % wide.
BINS = 20
# Classes of a file that the page names.
LIKELIEST = 3
# Unknown files that the page shows beside one that they are like.
ALIKE = 6

# A file as the page's script reads it.
Entry = dict[str, Any]

TEMPLATES = Path(__file__).parent / "templates"
# Entries of the page that are written at once.
BUFFERED = 200


class Gallery:
    """The classified files that the page shows, at most `most`.

    Beyond that, the most probable file of the largest class is dropped, so that doubtful files and
    small classes stay; unknown files count as a class.
    """

    def __init__(self, most: int) -> None:
        self.most = most
        self._held = 0
        self._order = itertools.count()
        # By class, the surest first: (-probability, order of arrival, file).
        self._classes: dict[str | None, list[tuple[float, int, Entry]]] = defaultdict(list)

    def add(
        self, answer: Answer, picture: bytes | None, embedding: NDArray[np.float32] | None
    ) -> None:
        """Add a file, and drop one if that makes too many. embedding: of an unknown one."""
        entry = {
            "file": answer.file or "-",
            "unknown": bool(answer.unknown),
            "likeliest": [(one.class_, one.probability) for one in answer.scores[:LIKELIEST]],
            "faces": answer.mesh.faces_in,
            "milliseconds": round(sum(answer.timings_ms.values()), 1),
            "picture": picture and base64.b64encode(picture).decode(),
            "embedding": embedding if answer.unknown else None,
        }
        key = None if answer.unknown else answer.class_
        heapq.heappush(self._classes[key], (-answer.probability, next(self._order), entry))
        self._held += 1
        if self._held > self.most:
            heapq.heappop(max(self._classes.values(), key=len))
            self._held -= 1

    def least_certain_first(self) -> list[Entry]:
        """The files, by ascending probability."""
        held = (one for files in self._classes.values() for one in files)
        files = [entry for _, _, entry in sorted(held, key=lambda one: (-one[0], one[1]))]
        return _with_alike(files)


def _with_alike(files: Sequence[Entry]) -> list[Entry]:
    """The files with "alike" for "embedding": the places of the ALIKE unknown files that are most
    like each unknown one, so that a person can name them together."""
    unknown = [i for i, entry in enumerate(files) if entry["embedding"] is not None]
    alike: dict[int, list[int]] = {}
    if len(unknown) > 1:
        embeddings = np.stack([files[i]["embedding"] for i in unknown])
        for place, one in zip(unknown, embeddings, strict=True):
            nearest = np.argsort(-(embeddings @ one), kind="stable")[: ALIKE + 1]
            alike[place] = [unknown[i] for i in nearest if unknown[i] != place][:ALIKE]
    return [
        {name: value for name, value in entry.items() if name != "embedding"}
        | {"alike": alike.get(place, [])}
        for place, entry in enumerate(files)
    ]


@dataclass
class Fault:
    """Refused files of one error code. named: the first of them."""

    files: int = 0
    named: list[Refusal] = field(default_factory=list)


class Report:
    """Counts and examples of a batch, collected one record after the other.

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
        self.faults: dict[str, Fault] = defaultdict(Fault)
        self.gallery = Gallery(most_shown)
        self._order = itertools.count()
        self._slowest: list[tuple[float, int, str, dict[str, float]]] = []

    def add(
        self,
        record: Answer | Refusal,
        picture: bytes | None = None,
        embedding: NDArray[np.float32] | None = None,
    ) -> None:
        """Take the record of one file, with its picture (`service.picture`) and its embedding where
        they are at hand."""
        if isinstance(record, Refusal):
            fault = self.faults[record.error.fault]
            fault.files += 1
            if len(fault.named) < MOST_NAMED:
                fault.named.append(record)
            return
        if record.unknown:
            self.unknown += 1
        else:
            self.classes[record.class_] += 1
            self.histogram[min(int(record.probability * BINS), BINS - 1)] += 1
        self.gallery.add(record, picture, embedding)
        timings = record.timings_ms
        slow = (sum(timings.values()), next(self._order), record.file or "-", timings)
        heapq.heappush(self._slowest, slow)
        if len(self._slowest) > SLOWEST:
            heapq.heappop(self._slowest)

    @property
    def classified(self) -> int:
        """Number of files with a class, without unknown ones."""
        return self.classes.total()

    @property
    def refused(self) -> int:
        """Number of refused files."""
        return sum(fault.files for fault in self.faults.values())

    @property
    def files(self) -> int:
        """Number of all files."""
        return self.classified + self.unknown + self.refused

    @property
    def slowest(self) -> list[tuple[str, dict[str, float]]]:
        """The files that took longest, slowest first, with their timings_ms."""
        return [(file, timings) for _, _, file, timings in sorted(self._slowest, reverse=True)]


def write_page(report: Report, path: Path, seconds: float) -> None:
    """Write the page of a report atomically, with names escaped. seconds: time of the batch.

    Raises OSError.
    """
    style, script = ((TEMPLATES / name).read_text("utf-8") for name in ("style.css", "script.js"))
    files = report.gallery.least_certain_first()
    stream = (
        _environment()
        .get_template("page.html")
        .stream(
            report=report,
            seconds=seconds,
            written=datetime.now().astimezone(),
            bins=BINS,
            files=files,
            without_picture=sum(file["picture"] is None for file in files),
            style=Markup(style),
            script=Markup(script),
            policy=_policy(style, script),
        )
    )
    stream.enable_buffering(BUFFERED)
    with replacing(path) as file:
        stream.dump(file, "utf-8")


# A mesh of a group: its file, how it differs from the first, and its picture, if any.
Member = tuple[str, str, bytes | None]


def write_groups(groups: Sequence[Sequence[Member]], source: str, total: int, path: Path) -> None:
    """Write a page with groups of meshes atomically. source, total: of all that were compared.

    Raises OSError.
    """
    style = (TEMPLATES / "style.css").read_text("utf-8")
    stream = (
        _environment()
        .get_template("groups.html")
        .stream(
            groups=[
                [
                    (file, differs, picture and base64.b64encode(picture).decode())
                    for file, differs, picture in group
                ]
                for group in groups
            ],
            members=sum(map(len, groups)),
            source=source,
            total=total,
            most=MOST_NAMED,
            style=Markup(style),
            policy=_policy(style),
        )
    )
    with replacing(path) as file:
        stream.dump(file, "utf-8")


def _environment() -> Environment:
    environment = Environment(
        loader=FileSystemLoader(TEMPLATES),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    environment.filters.update(count=_count, duration=_duration)
    return environment


def _policy(style: str, script: str = "") -> str:
    """A Content-Security-Policy: this style, this script, pictures in the page, and no more."""
    return "; ".join(
        (
            "default-src 'none'",
            f"script-src {_digest(script)}",
            f"style-src {_digest(style)}",
            "img-src data:",
            "base-uri 'none'",
            "form-action 'none'",
        )
    )


def _digest(source: str) -> str:
    return f"'sha256-{base64.b64encode(hashlib.sha256(source.encode()).digest()).decode()}'"


def _count(number: int) -> str:
    """Number with narrow spaces between thousands."""
    return f"{number:,}".replace(",", "\u202f")


def _duration(seconds: float) -> str:
    """Duration in words: 4.2 s, 3 min 20 s, 2 h 5 min."""
    if seconds < 60:
        return f"{seconds:.1f} s"
    minutes, rest = divmod(round(seconds), 60)
    if minutes < 60:
        return f"{minutes} min {rest} s"
    return f"{minutes // 60} h {minutes % 60} min"
