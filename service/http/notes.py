"""What is noted of one request on its way: its log line and the metrics are made of it."""

import asyncio
import hashlib
import uuid
from dataclasses import dataclass, field

from starlette.datastructures import Headers
from starlette.requests import Request

from meshconv3d.service.http.tracing import Trace

# Digits of a content's SHA-256 that are written down: enough to find the file again.
HASH_DIGITS = 16
# Hashing this many bytes takes so long that the event loop should not wait for it.
MANY_BYTES = 1024 * 1024


@dataclass
class Notes:
    """One request's notes.

    fault: the slug of the problem that answers it. received: bytes of the body.
    contents: the shortened SHA-256 of each mesh file. outcomes: the fault of each, "" for none.
    stages: what took how many seconds.
    """

    request_id: str
    trace: Trace
    fault: str | None = None
    received: int = 0
    contents: list[str] = field(default_factory=list)
    outcomes: list[str] = field(default_factory=list)
    stages: list[tuple[str, float]] = field(default_factory=list)

    @classmethod
    def begin(cls, headers: Headers) -> "Notes":
        """Those of a request that has just come."""
        return cls(uuid.uuid4().hex, Trace.of(headers.getlist("traceparent")))

    async def add_content(self, content: bytes) -> None:
        """Note which file was sent, without keeping anything of it."""
        if len(content) > MANY_BYTES:
            digest = await asyncio.to_thread(hashlib.sha256, content)
        else:
            digest = hashlib.sha256(content)
        self.contents.append(digest.hexdigest()[:HASH_DIGITS])


def notes_of(request: Request) -> Notes:
    """The notes of a request that `observing` has seen."""
    return request.state.notes
