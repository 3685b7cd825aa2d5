"""What a worker process runs: open the models once, then bytes in and records out.

Only plain values cross the border between the processes, and only errors that survive it.
"""

import gc
import signal
import traceback
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from meshconv3d.model.errors import MeshError, UnusableMesh
from meshconv3d.model.loading import Limits
from meshconv3d.model.mesh import Mesh
from meshconv3d.service.classifier import Classification, Classifier
from meshconv3d.service.evidence import FORMS, explain
from meshconv3d.service.models import ModelFile
from meshconv3d.service.records import answer
from meshconv3d.service.workers.limits import limit_cpu, limit_memory

# Of text that goes from process to process.
MOST_BYTES_PER_CHARACTER = 4


@dataclass(frozen=True)
class Setup:
    """What every worker is given at its start. memory_bytes: what one mesh may take, above what
    the models take; seconds: how long one task may compute; pictured: whether records have a
    picture, which needs an extra."""

    models: Sequence[ModelFile]
    limits: Limits
    memory_bytes: int
    seconds: float
    pictured: bool = False


@dataclass(frozen=True)
class Work:
    """One mesh to classify. file: its name, for the record; declared: what tells its format, or
    None; top: only so many classes; wanted: what is to be explained, or None."""

    model: str
    content: bytes
    file: str | None
    declared: str | None
    top: int | None = None
    wanted: "Wanted | None" = None

    @property
    def size(self) -> int:
        """Bytes that it takes to hand it over, at most, but for a frame of always the same."""
        names = sum(len(name) for name in (self.file, self.declared) if name is not None)
        return len(self.content) + MOST_BYTES_PER_CHARACTER * names


@dataclass(frozen=True)
class Wanted:
    """An explanation in one of `service.evidence.FORMS`, of the class `label` or the likeliest."""

    form: str
    label: str | None


@dataclass(frozen=True)
class Record:
    """What leaves, and what else is to be known of it.

    content: an `Answer` in JSON, or an explanation in its form. timings_ms: how long each stage
    took, in milliseconds. picture: a PNG of the prepared mesh, or None.

    scores, probabilities: N_c float32, in the order of the model's classes; label: the likeliest;
    unknown: None for a model without a limit.
    """

    content: bytes
    timings_ms: dict[str, float]
    label: str
    unknown: bool | None
    scores: NDArray[np.float32]
    probabilities: NDArray[np.float32]
    picture: bytes | None = None


class TaskFailed(Exception):
    """A task failed in a way that nobody foresaw; the message says where, and quotes no file."""


@dataclass(frozen=True)
class _Worker:
    """What this process has been set up with."""

    setup: Setup
    classifiers: dict[str, Classifier]


_worker: _Worker


def warm_up(setup: Setup) -> list[dict[str, Any]]:
    """Make this process a worker: open every model, test it, and take on the limits.

    Returns what each model says of itself. Raises ModelFileError or SelfTestError.
    """
    global _worker
    signal.signal(signal.SIGTERM, signal.SIG_IGN)  # as in `origin`
    classifiers = [Classifier(file.open(), setup.limits) for file in setup.models]
    for classifier in classifiers:
        classifier.self_test()
    if setup.pictured:
        import meshconv3d.service.picture  # noqa: F401  # before memory is limited
    gc.freeze()  # the libraries' objects need not be gone through again and again
    limit_memory(setup.memory_bytes)
    _worker = _Worker(setup, {c.model.card.name: c for c in classifiers})
    return [classifier.model.describe() for classifier in classifiers]


def classify(work: Work) -> Record:
    """Classify one mesh in a process that is warm, and explain it where that is wanted.

    Raises MeshError or TaskFailed.
    """
    limit_cpu(_worker.setup.seconds)
    try:
        return record_of(work, _worker.classifiers[work.model], _worker.setup.pictured)
    except MeshError as error:
        # A reader takes whatever goes wrong in it for a damaged file.
        if isinstance(error.__cause__, MemoryError):
            raise too_much_memory() from None
        raise
    except MemoryError:
        raise too_much_memory() from None
    except Exception as error:
        # Some exceptions of libraries cannot be rebuilt on the other side.
        raise TaskFailed(_where(error)) from None


def record_of(work: Work, classifier: Classifier, pictured: bool) -> Record:
    """Classify one mesh, or explain it, in whichever process this is.

    Raises what the classifier raises.
    """
    if work.wanted is not None:
        found = explain(classifier, work.content, work.declared, work.wanted.label)
        return _record(found.classification, FORMS[work.wanted.form].write(work.file, found))
    passed = classifier.run(*classifier.read(work.content, work.declared))
    result = passed.classification
    content = answer(work.file, result, work.top).model_dump_json(by_alias=True).encode()
    return _record(result, content, _picture(passed.prepared) if pictured else None)


def _record(result: Classification, content: bytes, picture: bytes | None = None) -> Record:
    return Record(
        content,
        result.timings_ms,
        result.label,
        result.unknown,
        result.scores,
        result.probabilities.astype(np.float32),
        picture,
    )


def _picture(mesh: Mesh) -> bytes:
    from meshconv3d.service.picture import picture

    return picture(mesh)


def _where(error: Exception) -> str:
    """The kind of an error and its traceback. Its message may quote the file, and is left out."""
    places = traceback.format_tb(error.__traceback__)
    return "".join([type(error).__qualname__, "\n", *places])


def too_much_memory() -> UnusableMesh:
    """What is wrong with a file that takes more than a worker may have."""
    return UnusableMesh(
        "too-much-memory",
        f"reading this file takes more than the {_worker.setup.memory_bytes} bytes of memory "
        "that one mesh is allowed; simplify the mesh or split it up",
    )
