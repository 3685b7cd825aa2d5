"""A request waits for its worker, as long as it makes sense."""

import asyncio
import time

from starlette.requests import ClientDisconnect, Request

from meshconv3d.service.http.admission import Full
from meshconv3d.service.http.gate import Visit
from meshconv3d.service.prediction import Prediction
from meshconv3d.service.workers import DeadlineExceeded, Job

# How often it is asked whether the client is still there, in seconds.
POLL_SECONDS = 0.25


async def result_of(job: Job, request: Request) -> Prediction:
    """The result of work that a request has in the pool.

    Work that has not begun, or has lost its worker, is dropped when its deadline has passed, and
    all of the request's when its client has gone. What runs is waited for: its worker keeps the
    deadline.

    Raises what the work raises, DeadlineExceeded, ClientDisconnect, or Full where the service
    ends before.
    """
    try:
        return await _result_of(job, request)
    except asyncio.CancelledError:
        raise Full("the service was stopped", 1, pause=0.0) from None


async def _result_of(job: Job, request: Request) -> Prediction:
    visit: Visit = request.state.visit
    answer = job.future
    while not answer.done():
        left = visit.expires - time.monotonic()
        if left <= 0 and job.cancel():
            raise DeadlineExceeded
        await asyncio.wait({answer}, timeout=min(left, POLL_SECONDS) if left > 0 else POLL_SECONDS)
        if not answer.done() and await request.is_disconnected() and visit.take_back():
            raise ClientDisconnect
    return answer.result()
