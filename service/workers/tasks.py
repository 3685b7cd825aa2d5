"""The program of a worker process: open the models once, then read tasks and write answers.

Tasks, predictions and errors are pickled to a socket: errors are of this project's kinds alone,
since those of libraries may not survive it.
"""

import dataclasses
import gc
import pickle
import signal
import socket
import traceback
from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import Path

from meshconv3d.export.metadata import ModelFileError
from meshconv3d.model import loading
from meshconv3d.model.errors import MeshError, UnusableMesh
from meshconv3d.model.loading import Limits
from meshconv3d.service.attribution import FORMS, explain
from meshconv3d.service.classifier import Classifier
from meshconv3d.service.models import ModelFile, ModelInfo
from meshconv3d.service.prediction import Prediction
from meshconv3d.service.workers.limits import (
    limit_cpu,
    limit_memory,
    release_memory,
    resident_memory,
)


@dataclass(frozen=True)
class Setup:
    """Start-up parameters of a worker. memory_bytes: for one mesh, above what the models take.
    seconds: time for one task. pictured: whether predictions have a picture (extra `report`)."""

    models: Sequence[ModelFile]
    limits: Limits
    memory_bytes: int
    seconds: float
    pictured: bool = False


@dataclass(frozen=True)
class ExplanationOptions:
    """An explanation in one of `attribution.FORMS`, of the class `label` or the likeliest."""

    form: str
    label: str | None


@dataclass(frozen=True)
class Task:
    """One mesh to classify. model: name of a model of the setup. file: name for the legend of an
    explanation, or None. declared: extension or media type, or None. explanation: None for none.
    pieces: other files that the mesh refers to, by their paths relative to it."""

    model: str
    content: bytes
    file: str | None
    declared: str | None
    explanation: ExplanationOptions | None = None
    pieces: Mapping[str, bytes] = field(default_factory=dict)


class TaskFailed(Exception):
    """An unexpected error in a task; the message is its kind and traceback, and quotes no file."""


# What a worker answers: at first the cards of its models, then a prediction for each task.
Answer = Sequence[ModelInfo] | Prediction | Exception


def work(connection: socket.socket, setup: Setup) -> None:
    """Entry point of a worker process: warm up, then answer tasks until the other end closes."""
    signal.signal(signal.SIGTERM, signal.SIG_IGN)  # multiprocessing resets what `preload` has set

    with suppress(OSError):  # if memory runs out, the kernel ends a worker, not the front
        Path("/proc/self/oom_score_adj").write_text("1000")

    def send(answer: Answer) -> None:
        connection.sendall(pickle.dumps(answer, pickle.HIGHEST_PROTOCOL))

    with suppress(EOFError, OSError):
        try:
            classifiers = warm_up(setup)
        except Exception as error:
            send(error)
            return
        send([classifier.model.info for classifier in classifiers.values()])
        tasks, warm = connection.makefile("rb"), resident_memory()
        while True:
            limit_cpu(setup.seconds)
            limit_memory(setup.memory_bytes)
            try:
                task = pickle.load(tasks)
            except MemoryError:
                send(too_much_memory(setup))
                return  # the rest of the task is still in the stream
            send(answer_to(task, classifiers, setup))
            del task
            release_memory(warm)


def warm_up(setup: Setup) -> dict[str, Classifier]:
    """Open and test every model, and import all that reading may need.

    Raises ModelFileError or SelfTestError for a model that cannot serve, ModelFileError for two of
    one name.
    """
    classifiers = {}
    for file in setup.models:
        classifier = Classifier(file.open(), setup.limits)
        classifier.self_test()
        name = classifier.model.card.name
        if name in classifiers:
            raise ModelFileError(f"models are told apart by their names, but two are {name!r}")
        classifiers[name] = classifier
    loading.warm_up()
    if setup.pictured:
        import meshconv3d.service.picture  # noqa: F401 (before memory is limited)
    gc.freeze()  # garbage collection skips the libraries' objects
    return classifiers


def answer_to(
    task: Task, classifiers: dict[str, Classifier], setup: Setup
) -> Prediction | MeshError | TaskFailed:
    """Result of one task, or the error that it has instead."""
    try:
        return predict(task, classifiers[task.model], setup.pictured)
    except MeshError as error:
        # Readers take any error inside them for a damaged file.
        ran_out = isinstance(error.__cause__, MemoryError)
        return too_much_memory(setup) if ran_out else error.with_traceback(None)
    except MemoryError:
        return too_much_memory(setup)
    except Exception as error:
        # The message of the error may quote the file, and is left out.
        places = traceback.format_tb(error.__traceback__)
        return TaskFailed("".join([type(error).__qualname__, "\n", *places]))


def predict(task: Task, classifier: Classifier, pictured: bool) -> Prediction:
    """Classify one mesh, or explain it, in this process. Raises what the classifier raises."""
    if task.explanation is not None:
        found = explain(
            classifier, task.content, task.declared, task.explanation.label, task.pieces
        )
        content = FORMS[task.explanation.form].write(task.file, found)
        return dataclasses.replace(found.prediction, explanation=content)
    passed = classifier.run(*classifier.read(task.content, task.declared, task.pieces))
    if not pictured:
        return passed.prediction
    from meshconv3d.service.picture import picture

    return dataclasses.replace(passed.prediction, picture=picture(passed.prepared))


def too_much_memory(setup: Setup) -> UnusableMesh:
    """Error of a mesh that takes more memory than one mesh may."""
    return UnusableMesh(
        "too-much-memory",
        f"reading this file takes more than the {setup.memory_bytes} bytes of memory "
        "that one mesh is allowed; simplify the mesh or split it up",
    )
