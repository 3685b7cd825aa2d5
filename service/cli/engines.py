"""Which engine a call of `classify` gets."""

import logging
from collections.abc import Sequence
from pathlib import Path

import click

from meshconv3d.export.metadata import ModelFileError
from meshconv3d.service.batch.classifying import Classify
from meshconv3d.service.batch.engines import Engine, EngineFailed, Here, Workers
from meshconv3d.service.batch.entries import StandardInput
from meshconv3d.service.batch.listing import Listing
from meshconv3d.service.batch.local import LocalFile
from meshconv3d.service.classifier import SelfTestError
from meshconv3d.service.cli.explain import explaining
from meshconv3d.service.cli.shared import load_classifier
from meshconv3d.service.models import ModelFile
from meshconv3d.service.prediction import ModelId
from meshconv3d.service.settings import Settings
from meshconv3d.service.workers import NotStarted, Setup, ThreadedPool, predict

# As many files are classified in this process before worker processes would be ready.
FEW = 16


def open_engine(
    listing: Listing,
    model: str | None,
    settings: Settings,
    may_be_here: bool,
    ordered: bool,
    pictured: bool,
) -> tuple[ModelId, Engine]:
    """The engine for some files, and its model: this process for a few if it may be, worker
    processes for more. pictured: with a picture of each. A model that cannot serve is a usage
    error."""
    if may_be_here and len(listing.first(FEW + 1)) <= FEW:
        classifier = load_classifier(model)
        return classifier.model.id, Here(lambda task: predict(task, classifier, pictured))
    pool = _start_workers(model or settings.models[0], settings, pictured)
    (served,) = pool.models.values()
    return served.id, Workers(pool, settings.workers, ordered)


def ray_engine(
    model: str | None,
    settings: Settings,
    workers: int | None,
    ordered: bool,
    pictured: bool,
    address: str | None,
) -> tuple[ModelId, Engine]:
    """As `open_engine`, over a Ray cluster; see `Ray`."""
    from meshconv3d.service.batch.ray_engine import Ray

    model_id = load_classifier(model).model.id
    file = ModelFile.read(model or settings.models[0])
    try:
        return model_id, Ray(_setup(file, settings, pictured), workers, ordered, address)
    except EngineFailed as error:
        raise click.ClickException(str(error)) from None


def explaining_engine(
    listing: Listing, model: str | None, out: Path, label: str | None
) -> tuple[ModelId, Engine]:
    """As `open_engine`, with explanations written to OUT."""
    files = _local(listing)
    classifier = load_classifier(model)
    classify: Classify = explaining(classifier, files, out, label)
    return classifier.model.id, Here(classify)


def _start_workers(model: str, settings: Settings, pictured: bool) -> ThreadedPool:
    # A worker that a file has ended is that file's record.
    logging.getLogger("meshconv3d.service.workers").setLevel(logging.ERROR)
    try:
        pool = ThreadedPool(_setup(ModelFile.read(model), settings, pictured), settings.workers)
        pool.start()
    except (ModelFileError, SelfTestError) as error:
        raise click.UsageError(str(error)) from None
    except NotStarted as error:
        raise click.ClickException(str(error)) from None
    return pool


def _setup(file: ModelFile, settings: Settings, pictured: bool) -> Setup:
    limits, memory = settings.limits, settings.worker_memory_bytes
    return Setup([file], limits, memory, settings.deadline_seconds, pictured)


def _local(listing: Listing) -> Sequence[str]:
    files = []
    for entry in listing:
        if not isinstance(entry, LocalFile | StandardInput):
            raise click.UsageError(f"--explain is for files of this machine, not {entry.name}")
        files.append(entry.path if isinstance(entry, LocalFile) else entry.name)
    return files
