"""Mesh files are read and classified in processes of their own, which a file may break.

`process` is the inside of one: `tasks` is what it does, `limits` what the system holds it to,
`origin` where it is forked from. `frames` is how both sides speak. On the other, `worker` is one
process; a `seat` keeps one at work with what waits in `jobs`, and replaces it. The `pool` has all
of them, for an event loop; `threads` is the same for those who have none. None of it knows of HTTP.
"""

from meshconv3d.service.workers.jobs import Job
from meshconv3d.service.workers.pool import WorkerPool
from meshconv3d.service.workers.tasks import ExplanationOptions, Setup, Task, TaskFailed, predict
from meshconv3d.service.workers.threads import ThreadedPool
from meshconv3d.service.workers.worker import DeadlineExceeded, NotStarted

__all__ = [
    "DeadlineExceeded",
    "ExplanationOptions",
    "Job",
    "NotStarted",
    "Setup",
    "Task",
    "TaskFailed",
    "ThreadedPool",
    "WorkerPool",
    "predict",
]
