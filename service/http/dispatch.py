"""Dispatch: from the meshes of a request to their results, by the worker pool."""

import asyncio
import hashlib
import time
from collections.abc import AsyncIterator, Sequence
from dataclasses import dataclass

from starlette.requests import ClientDisconnect, Request

from meshconv3d.service.http.admission import Admission, admitted
from meshconv3d.service.http.context import context_of
from meshconv3d.service.http.problems import Full, RequestError, request_error
from meshconv3d.service.models import ModelInfo
from meshconv3d.service.prediction import Prediction
from meshconv3d.service.settings import Settings
from meshconv3d.service.workers import DeadlineExceeded, Job, Task, WorkerPool

# Seconds between looks at whether the client is still there.
POLL_SECONDS = 0.25
# Digits of a content's SHA-256 in the log: enough to find the file again.
HASH_DIGITS = 16
# Hashing this many bytes takes so long that it is done off the event loop.
MANY_BYTES = 1024 * 1024


@dataclass(frozen=True)
class Dispatcher:
    """The workers of one app, its admission control and its settings."""

    pool: WorkerPool
    admission: Admission
    settings: Settings

    @property
    def ready(self) -> bool:
        """Whether a worker has given a known mesh its scores, and work is admitted."""
        return self.pool.alive > 0 and self.admission.open

    def model(self, name: str | None) -> ModelInfo:
        """A model that is served; with None, the first. Raises RequestError."""
        if name is None:
            name = next(iter(self.pool.models))
        if name not in self.pool.models:
            detail = f"no model {name!r} is served here, but {', '.join(self.pool.models)}"
            raise RequestError(404, "not-found", detail)
        return self.pool.models[name]

    async def predict(self, request: Request, task: Task) -> Prediction:
        """Classify the one mesh of a request. Raises MeshError, DeadlineExceeded, TaskFailed,
        ClientDisconnect or Full."""
        [job] = await self.submit(request, [task])
        [result] = [result async for result in self.results(request, [job])]
        if isinstance(result, Exception):
            raise result
        return result

    async def submit(self, request: Request, tasks: Sequence[Task]) -> list[Job]:
        """Queue all meshes of a request. Those that have not begun when it ends are dropped.

        Raises Full, and then none is queued.
        """
        share = admitted(request)
        share.enter(len(tasks))
        context_of(request).hashes += await _shortened_hashes([task.content for task in tasks])
        share.jobs += [self.pool.submit(task, share.expires) for task in tasks]
        return share.jobs

    async def results(
        self, request: Request, jobs: Sequence[Job]
    ) -> AsyncIterator[Prediction | Exception]:
        """The result of each mesh, or why it has none, in order. Raises ClientDisconnect."""
        share, context = admitted(request), context_of(request)
        result: Prediction | Exception | None = None
        for number, job in enumerate(jobs):
            if number and await request.is_disconnected():
                raise ClientDisconnect
            if not isinstance(result, Full):  # the service ends: no more will come
                result = await _result(request, job)
            share.answer()
            if isinstance(result, Exception):
                context.outcomes.append(request_error(result).fault)
            else:
                context.outcomes.append("")
                context.stages.append(("queue", job.queued_seconds))
                context.stages += [(s, ms / 1000) for s, ms in result.timings_ms.items()]
            yield result


async def _result(request: Request, job: Job) -> Prediction | Exception:
    """The result of one mesh.

    What has not begun is dropped when its deadline has passed, and all such meshes of a request
    when its client has gone. What runs is waited for: its worker keeps the deadline.
    """
    share, result = admitted(request), asyncio.wrap_future(job)
    try:
        while not result.done():
            left = share.expires - time.monotonic()
            if left <= 0 and job.cancel():
                return DeadlineExceeded()
            timeout = min(left, POLL_SECONDS) if left > 0 else POLL_SECONDS
            await asyncio.wait({result}, timeout=timeout)
            if not result.done() and await request.is_disconnected() and share.cancel():
                raise ClientDisconnect
        return result.result()
    except ClientDisconnect:
        raise
    except asyncio.CancelledError:
        return Full("the service was stopped", 1, pause=0.0)
    except Exception as error:
        return error.with_traceback(None)  # which holds this frame, and that the uploaded bytes


async def _shortened_hashes(contents: Sequence[bytes]) -> list[str]:
    if sum(map(len, contents)) > MANY_BYTES:
        return await asyncio.to_thread(_hashes, contents)
    return _hashes(contents)


def _hashes(contents: Sequence[bytes]) -> list[str]:
    return [hashlib.sha256(content).hexdigest()[:HASH_DIGITS] for content in contents]
