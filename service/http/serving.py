"""What all routes share: the models, and the way of mesh files to their records."""

import traceback
from collections.abc import AsyncIterator, Awaitable, Sequence
from dataclasses import dataclass

from fastapi import HTTPException, Request
from starlette.requests import ClientDisconnect

from meshconv3d.service.http.admission import Admission, Full
from meshconv3d.service.http.gate import Visit
from meshconv3d.service.http.metrics import Metrics
from meshconv3d.service.http.notes import notes_of
from meshconv3d.service.http.problems import reason
from meshconv3d.service.http.waiting import result_of
from meshconv3d.service.models import ModelInfo
from meshconv3d.service.prediction import Prediction
from meshconv3d.service.settings import Settings
from meshconv3d.service.workers import Job, Task, WorkerPool

# A mesh's prediction, or the error that it has instead.
Outcome = Prediction | Exception


@dataclass(frozen=True)
class Serving:
    """One app's workers, queue, settings and counters."""

    pool: WorkerPool
    admission: Admission
    settings: Settings
    metrics: Metrics

    @property
    def ready(self) -> bool:
        """Whether there is a worker that gave a known mesh its scores, and work is taken."""
        return self.pool.alive > 0 and self.admission.open

    def model(self, name: str | None) -> ModelInfo:
        """A model that is served; with None, the first. Raises HTTPException."""
        if name is None:
            name = next(iter(self.pool.models))
        if name not in self.pool.models:
            names = ", ".join(self.pool.models)
            raise HTTPException(404, f"no model {name!r} is served here, but {names}")
        return self.pool.models[name]

    async def predict(self, request: Request, task: Task) -> Prediction:
        """Classify the one mesh of a request. Raises what `WorkerPool.submit` says, or Full."""
        jobs = await self.submit(request, [task])
        [outcome] = [outcome async for outcome in self.outcomes(request, jobs)]
        if isinstance(outcome, Exception):
            raise outcome
        return outcome

    async def submit(self, request: Request, tasks: Sequence[Task]) -> list[Job]:
        """Queue all meshes of a request. What has not begun when it ends is taken back.

        Raises Full, and then none is queued.
        """
        visit: Visit = request.state.visit
        visit.take_on(len(tasks))
        for task in tasks:
            await notes_of(request).add_content(task.content)
        visit.jobs += [self.pool.submit(task, visit.expires) for task in tasks]
        return visit.jobs

    async def outcomes(self, request: Request, jobs: Sequence[Job]) -> AsyncIterator[Outcome]:
        """What became of each mesh that was queued, in order. Raises ClientDisconnect."""
        visit: Visit = request.state.visit
        notes = notes_of(request)
        outcome: Outcome | None = None
        for number, job in enumerate(jobs):
            if number and await request.is_disconnected():
                raise ClientDisconnect
            if not isinstance(outcome, Full):  # the service ends: no more will come
                outcome = await _outcome(result_of(job, request))
            visit.finish()
            if isinstance(outcome, Exception):
                notes.outcomes.append(reason(outcome).fault)
            else:
                notes.outcomes.append("")
                notes.stages.append(("queue", job.waited))
                notes.stages += [(s, ms / 1000) for s, ms in outcome.timings_ms.items()]
            yield outcome


async def _outcome(prediction: Awaitable[Prediction]) -> Outcome:
    try:
        return await prediction
    except ClientDisconnect:
        raise
    except Exception as error:
        # What waited has the error, and the error, by its traceback, what waited and the request.
        traceback.clear_frames(error.__traceback__)
        return error
