"""What a worker process runs: open the models once, then bytes in and records out.

Only plain values cross the border between the processes, and only errors that survive it.
"""

import dataclasses
import gc
import signal
import traceback
from collections.abc import Sequence
from dataclasses import dataclass

from meshconv3d.model import loading
from meshconv3d.model.errors import MeshError, UnusableMesh
from meshconv3d.model.loading import Limits
from meshconv3d.model.mesh import Mesh
from meshconv3d.service.attribution import FORMS, explain
from meshconv3d.service.classifier import Classifier
from meshconv3d.service.models import ModelFile, ModelInfo
from meshconv3d.service.prediction import Prediction
from meshconv3d.service.workers.limits import limit_cpu, limit_memory

# Of text that goes from process to process.
MOST_BYTES_PER_CHARACTER = 4


@dataclass(frozen=True)
class Setup:
    """What every worker is given at its start. memory_bytes: what one mesh may take, above what
    the models take; seconds: how long one task may compute; pictured: whether results have a
    picture, which needs an extra."""

    models: Sequence[ModelFile]
    limits: Limits
    memory_bytes: int
    seconds: float
    pictured: bool = False


@dataclass(frozen=True)
class Task:
    """One mesh to classify. model: name of a model of the setup. file: name for the legend of an
    explanation, or None. declared: extension or media type, or None. explanation: None for none."""

    model: str
    content: bytes
    file: str | None
    declared: str | None
    explanation: "ExplanationOptions | None" = None

    @property
    def size(self) -> int:
        """Bytes that it takes to hand it over, at most, but for a frame of always the same."""
        names = sum(len(name) for name in (self.file, self.declared) if name is not None)
        return len(self.content) + MOST_BYTES_PER_CHARACTER * names


@dataclass(frozen=True)
class ExplanationOptions:
    """An explanation in one of `attribution.FORMS`, of the class `label` or the likeliest."""

    form: str
    label: str | None


class TaskFailed(Exception):
    """A task failed in a way that nobody foresaw; the message says where, and quotes no file."""


@dataclass(frozen=True)
class _Worker:
    """What this process has been set up with."""

    setup: Setup
    classifiers: dict[str, Classifier]


_worker: _Worker


def warm_up(setup: Setup) -> list[ModelInfo]:
    """Make this process a worker: open every model, test it, and take on the limits.

    Returns the card of each model. Raises ModelFileError or SelfTestError.
    """
    global _worker
    signal.signal(signal.SIGTERM, signal.SIG_IGN)  # as in `origin`
    classifiers = [Classifier(file.open(), setup.limits) for file in setup.models]
    for classifier in classifiers:
        classifier.self_test()
    loading.warm_up()
    if setup.pictured:
        import meshconv3d.service.picture  # noqa: F401  # before memory is limited
    gc.freeze()  # the libraries' objects need not be gone through again and again
    limit_memory(setup.memory_bytes)
    _worker = _Worker(setup, {c.model.card.name: c for c in classifiers})
    return [classifier.model.info for classifier in classifiers]


def classify(task: Task) -> Prediction:
    """Classify one mesh in a process that is warm, and explain it where that is wanted.

    Raises MeshError or TaskFailed.
    """
    limit_cpu(_worker.setup.seconds)
    try:
        return predict(task, _worker.classifiers[task.model], _worker.setup.pictured)
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


def predict(task: Task, classifier: Classifier, pictured: bool) -> Prediction:
    """Classify one mesh, or explain it, in this process. Raises what the classifier raises."""
    if task.explanation is not None:
        found = explain(classifier, task.content, task.declared, task.explanation.label)
        content = FORMS[task.explanation.form].write(task.file, found)
        return dataclasses.replace(found.prediction, explanation=content)
    passed = classifier.run(*classifier.read(task.content, task.declared))
    if not pictured:
        return passed.prediction
    return dataclasses.replace(passed.prediction, picture=_picture(passed.prepared))


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
