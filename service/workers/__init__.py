"""Mesh files are read and classified in processes of their own, which a file may break.

`tasks` is what runs in such a process, `limits` what the system holds it to, `origin` where it is
forked from. On the other side, `worker` is one process, and `pool` keeps several alive and hands
them work from an event loop; `threads` is the same for those who have none. None of it knows of
HTTP.
"""

from service.workers.jobs import Job
from service.workers.pool import WorkerPool
from service.workers.tasks import Record, Setup, TaskFailed, Wanted, Work, record_of
from service.workers.threads import ThreadedPool
from service.workers.worker import DeadlineExceeded, NotStarted

__all__ = [
    "DeadlineExceeded",
    "Job",
    "NotStarted",
    "Record",
    "Setup",
    "TaskFailed",
    "ThreadedPool",
    "Wanted",
    "Work",
    "WorkerPool",
    "record_of",
]
