"""What stands behind the app, as the settings say: workers that are warm, and what is let in."""

from meshconv3d.service.http.admission import Admission
from meshconv3d.service.models import ModelFile
from meshconv3d.service.settings import Settings
from meshconv3d.service.workers import Setup, WorkerPool


def start_workers(settings: Settings) -> WorkerPool:
    """Start all workers and wait until they are warm.

    Raises ModelFileError, SelfTestError or NotStarted.
    """
    files = [ModelFile.read(name) for name in settings.models]
    setup = Setup(files, settings.limits, settings.worker_memory_bytes, settings.deadline_seconds)
    pool = WorkerPool(setup, settings.workers)
    pool.start()
    return pool


def open_admission(settings: Settings) -> Admission:
    """Let in as much as the settings bound."""
    return Admission(
        settings.max_queue_requests,
        settings.max_queue_bytes,
        settings.deadline_seconds,
        settings.workers,
    )
