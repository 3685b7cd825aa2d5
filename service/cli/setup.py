"""First steps of several commands: read the settings, open the model, list the files, start the
executor. Mistakes in a call are usage errors, before anything is classified."""

import logging
import resource
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from functools import partial
from typing import TYPE_CHECKING, Any

import click

if TYPE_CHECKING:
    from meshconv3d.service.batch.listing import Choice, Listing
    from meshconv3d.service.batch.running import PoolExecutor, SerialExecutor
    from meshconv3d.service.classifier import Classifier
    from meshconv3d.service.prediction import ModelId
    from meshconv3d.service.settings import Settings
    from meshconv3d.service.workers import Setup

# Bytes of address space: with 600 MB, compiling the kernels fails.
LEAST_MEMORY = 768 * 2**20

model_option: Callable[..., Any] = click.option(
    "--model",
    help="Shipped model by name, or a model file. [default: MESHCONV3D_MODELS, or objects]",
)
top_option: Callable[..., Any] = click.option(
    "--top", type=click.IntRange(1), help="Only the N likeliest classes of each."
)
resume_option: Callable[..., Any] = click.option(
    "--resume", is_flag=True, help="Go on with an output that was interrupted."
)
workers_option: Callable[..., Any] = click.option(
    "--workers", type=click.IntRange(1, 256), help="Processes. [default: usable cores]"
)
format_option: Callable[..., Any] = click.option(
    "--format",
    "declared",
    help="Format of standard input, and of files that are named, such as stl.",
)


@contextmanager
def usage_errors(*kinds: type[Exception], option: str = "") -> Iterator[None]:
    """Within it, these exceptions are usage errors, of an option."""
    try:
        yield
    except kinds as error:
        raise click.UsageError(f"{option} {error}".lstrip()) from None


def read_settings(flags: Mapping[str, Any]) -> "Settings":
    """The settings, with the flags that were given over them; a bad one is a usage error."""
    from pydantic import ValidationError

    from meshconv3d.service.settings import Settings

    _check_memory()
    given = {name: value for name, value in flags.items() if value not in (None, ())}
    try:
        return Settings(**given)
    except ValidationError as error:
        raise click.UsageError("; ".join(map(_bad_setting, error.errors()))) from None


def _check_memory() -> None:
    """Raise a usage error for a limit on memory under which the libraries would abort."""
    most, _ = resource.getrlimit(resource.RLIMIT_AS)
    if most != resource.RLIM_INFINITY and most < LEAST_MEMORY:
        raise click.UsageError(
            f"the process may have only {most >> 10} kB of memory (ulimit -v): raise that to "
            f"{LEAST_MEMORY >> 10} or more"
        )


def _bad_setting(error: Mapping[str, Any]) -> str:
    reason = error["msg"].removeprefix("Value error, ")
    if not error["loc"]:
        return f"bad settings: {reason}"
    name = str(error["loc"][0])
    return f"bad setting: {name} (MESHCONV3D_{name.upper()}): {reason}"


def load_classifier(model: str | None) -> "Classifier":
    """The classifier for a --model value or the settings' default, within the settings' limits
    on one file, tested on its own sample.

    A model that is missing, damaged, or does not give its own scores is a usage error.
    """
    from meshconv3d.model.errors import Error
    from meshconv3d.service.classifier import Classifier, slow_start_told

    settings = read_settings({})
    with usage_errors(Error), slow_start_told(partial(click.echo, err=True)):
        return Classifier.load(model or settings.models[0], settings.limits)


def list_files(
    paths: Sequence[str], choice: "Choice | None" = None, declared: str | None = None
) -> "Listing":
    """The files behind some paths; see `Listing`. Paths that name none are a usage error."""
    from meshconv3d.model.loading import FORMATS
    from meshconv3d.service.batch.listing import STDIN, Listing, NotListed

    if declared and declared.lower() not in FORMATS:
        raise click.UsageError(f"unknown --format {declared!r}: choose from {', '.join(FORMATS)}")
    if paths.count(STDIN) > 1:
        raise click.UsageError("- stands for standard input, which holds one mesh: name it once")
    with usage_errors(NotListed):
        return Listing(paths, choice, declared)


def serial_executor(model: str | None, settings: "Settings") -> "tuple[ModelId, SerialExecutor]":
    """This process, and the model that it has opened."""
    from meshconv3d.service.batch.running import Options, SerialExecutor
    from meshconv3d.service.workers import predict

    classifier = load_classifier(model)
    options = Options(classifier.model.id.name, settings.worker_memory_bytes)
    executor = SerialExecutor(lambda task: predict(task, classifier, False), options)
    return classifier.model.id, executor


def pool_executor(
    model: str | None, settings: "Settings", pictured: bool = False
) -> "tuple[ModelId, PoolExecutor]":
    """Worker processes that have started, and their model. pictured: with a picture of each
    mesh."""
    from meshconv3d.export.metadata import ModelFileError
    from meshconv3d.service.batch.running import Options, PoolExecutor
    from meshconv3d.service.classifier import SelfTestError, slow_start_told
    from meshconv3d.service.workers import NotStarted, WorkerPool

    # A worker that a file has ended is that file's record.
    logging.getLogger("meshconv3d.service.workers").setLevel(logging.ERROR)
    try:
        with usage_errors(ModelFileError, SelfTestError):
            pool = WorkerPool(worker_setup(model, settings, pictured), settings.workers)
            with slow_start_told(partial(click.echo, err=True)):
                pool.start()
    except NotStarted as error:
        raise click.ClickException(str(error)) from None
    (info,) = pool.models.values()
    options = Options(info.id.name, settings.worker_memory_bytes)
    return info.id, PoolExecutor(pool, settings.workers, options)


def worker_setup(model: str | None, settings: "Settings", pictured: bool) -> "Setup":
    """Setup of the worker processes."""
    from meshconv3d.service.models import ModelFile
    from meshconv3d.service.workers import Setup

    file = ModelFile.read(model or settings.models[0])
    memory, seconds = settings.worker_memory_bytes, settings.deadline_seconds
    return Setup([file], settings.limits, memory, seconds, pictured)
