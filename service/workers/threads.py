"""The pool for those who wait in threads."""

import asyncio
import threading
from concurrent.futures import Future

from meshconv3d.service.models import ModelInfo
from meshconv3d.service.prediction import Prediction
from meshconv3d.service.workers.pool import WorkerPool
from meshconv3d.service.workers.tasks import Setup, Task


class ThreadedPool:
    """A `WorkerPool` with an event loop of its own, which any thread can give work.

    >>> pool = ThreadedPool(Setup([ModelFile.read("shrec11")], Limits(), 2**31, 30), workers=2)
    >>> pool.start()
    >>> pool.submit(Task("shrec11", content, None, "obj")).result().label
    """

    def __init__(self, setup: Setup, workers: int) -> None:
        self._pool = WorkerPool(setup, workers)
        self._loop: asyncio.AbstractEventLoop | None = None

    @property
    def models(self) -> dict[str, ModelInfo]:
        """See `WorkerPool.start`."""
        return self._pool.models

    @property
    def alive(self) -> int:
        """How many workers are warm."""
        return self._pool.alive

    @property
    def restarts(self) -> int:
        """How many workers were replaced so far."""
        return self._pool.restarts

    def start(self) -> None:
        """See `WorkerPool.start`."""
        self._pool.start()
        self._loop = asyncio.new_event_loop()
        self._loop.call_soon(self._pool.attach)
        # It goes on after a close, so that nobody waits for ever who comes after that.
        threading.Thread(target=self._loop.run_forever, daemon=True, name="worker-pool").start()

    def submit(self, work: Task, expires: float | None = None) -> Future[Prediction]:
        """See `WorkerPool.submit`. The future is cancelled where the pool is closed before."""
        assert self._loop is not None, "the pool has not started"
        return asyncio.run_coroutine_threadsafe(self._record(work, expires), self._loop)

    async def _record(self, work: Task, expires: float | None) -> Prediction:
        job = self._pool.submit(work, expires)
        del work  # or an error would keep it, by its traceback and this frame
        return await job.future

    def close(self) -> None:
        """See `WorkerPool.close`."""
        if self._loop is not None:
            asyncio.run_coroutine_threadsafe(self._close(), self._loop).result()

    async def _close(self) -> None:
        self._pool.close()
        await self._pool.wait_closed()
