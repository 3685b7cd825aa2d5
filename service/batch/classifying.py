"""The outcome of one file: read, told apart by its content, classified by whoever can."""

import hashlib
import json
import logging
from collections.abc import Callable, Collection
from dataclasses import asdict, dataclass

from meshconv3d.model.errors import MeshError, UnusableMesh
from meshconv3d.model.loading import Limits
from meshconv3d.service.batch.entries import Entry
from meshconv3d.service.prediction import Failure, Prediction
from meshconv3d.service.records import record, to_json
from meshconv3d.service.workers import DeadlineExceeded, Task, TaskFailed

log = logging.getLogger(__name__)


# Raises MeshError, DeadlineExceeded or TaskFailed.
Classify = Callable[[Task], Prediction]
# With which contents, by their SHA-256, the next file of this name need not be classified (again).
# Asked for each file once, before it is handed to whoever reads it.
DoneAs = Callable[[str], Collection[str]]

# Faults that another attempt may not find: they speak of the machine as much as of the file.
PASSING = frozenset({"deadline", "internal", "too-much-memory", "worker-crashed"})


@dataclass(frozen=True)
class Options:
    """What is asked of every file. model: the name of one that has been opened. top: only so many
    classes; bytes: larger files are not read."""

    model: str
    top: int | None
    bytes: int


@dataclass(frozen=True)
class Outcome:
    """What became of one file, which is `entry`.

    record: an `Answer` or a `Refusal` in JSON. sha256: of the content; None if it was not read.
    fault: why it was not classified; None if it was. picture: a PNG of it, or None.
    """

    entry: Entry
    record: bytes
    sha256: str | None
    fault: str | None
    picture: bytes | None = None


def run_id(model_sha256: str, top: int | None, limits: Limits) -> str:
    """What a record depends on beside the file, as 16 hexadecimal digits."""
    parts = {"model": model_sha256, "top": top, "limits": asdict(limits)}
    return hashlib.sha256(json.dumps(parts, sort_keys=True).encode()).hexdigest()[:16]


def classify_entry(
    entry: Entry, options: Options, classify: Classify, done: Collection[str]
) -> Outcome | None:
    """The outcome of one file, whatever the file is; None for one that is done: see `DoneAs`.

    Any engine calls this for each file, in whichever process has a way to `classify`.
    """
    sha256 = None
    try:
        _check_size(entry.size(), options.bytes)
        content = entry.read()
        sha256 = hashlib.sha256(content).hexdigest()
        if sha256 in done:
            return None
        found = classify(Task(options.model, content, entry.name, entry.declared))
        content = to_json(record(entry.name, found, options.top))
        return Outcome(entry, content, sha256, None, found.picture)
    except (MeshError, OSError, DeadlineExceeded, TaskFailed) as error:
        failure = _failure(error)
        return Outcome(entry, to_json(record(entry.name, failure)), sha256, failure.fault)


def _check_size(size: int, most: int) -> None:
    if size > most:
        raise UnusableMesh(
            "too-much-memory",
            f"the file has {size} bytes, more than the {most} bytes of memory that one mesh is "
            "allowed; simplify the mesh or split it up",
        )


def _failure(error: MeshError | OSError | DeadlineExceeded | TaskFailed) -> Failure:
    if isinstance(error, MeshError | OSError):
        return Failure.of(error)
    if isinstance(error, DeadlineExceeded):
        message = "classifying it took longer than the deadline; simplify the mesh, or allow more"
        return Failure("deadline", message)
    log.error("one mesh failed: %s", error)
    message = "classifying it failed in a way that nobody foresaw; report it, with the file"
    return Failure("internal", message)
