"""Worker processes that read and classify meshes, so that a file can break its own process alone.

`pool` queues tasks and gives futures; `worker` runs one process: it starts it, hands it one task at
a time, and replaces it when it dies. `tasks` is what the process runs, `limits` what the system
bounds it to, `preload` what the fork server imports. None of it knows of HTTP.
"""

from meshconv3d.service.workers.pool import Job, WorkerPool
from meshconv3d.service.workers.tasks import ExplanationOptions, Setup, Task, TaskFailed, predict
from meshconv3d.service.workers.worker import DeadlineExceeded, NotStarted

__all__ = [
    "DeadlineExceeded",
    "ExplanationOptions",
    "Job",
    "NotStarted",
    "Setup",
    "Task",
    "TaskFailed",
    "WorkerPool",
    "predict",
]
