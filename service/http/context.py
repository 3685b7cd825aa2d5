"""Request context: what is recorded about one request on its way, for the log and the metrics."""

import re
import secrets
import uuid
from collections.abc import Sequence
from dataclasses import dataclass, field

from starlette.requests import Request

# W3C Trace Context: version, trace, caller's span, flags; later versions may append more.
_TRACEPARENT = re.compile(r"(?!ff)([0-9a-f]{2})-([0-9a-f]{32})-([0-9a-f]{16})-([0-9a-f]{2})(-.*)?")
_NO_TRACE, _NO_SPAN = "0" * 32, "0" * 16


@dataclass
class RequestContext:
    """Facts about one request.

    trace_id (32 hexadecimal digits), span_id (16, its own) and flags (2): its place in a trace.
    fault: error code of its answer, or None. received: bytes of the body so far. hashes: shortened
    SHA-256 of each mesh file. outcomes: error code of each, "" for none. stages: (name, seconds).
    """

    trace_id: str = field(default_factory=lambda: secrets.token_hex(16))
    span_id: str = field(default_factory=lambda: secrets.token_hex(8))
    flags: str = "00"
    request_id: str = field(default_factory=lambda: uuid.uuid4().hex)
    fault: str | None = None
    received: int = 0
    hashes: list[str] = field(default_factory=list)
    outcomes: list[str] = field(default_factory=list)
    stages: list[tuple[str, float]] = field(default_factory=list)

    @classmethod
    def begin(cls, traceparents: Sequence[str]) -> "RequestContext":
        """The context of a new request: below the caller's span, if one valid header gives it."""
        found = _TRACEPARENT.fullmatch(traceparents[0]) if len(traceparents) == 1 else None
        if found is not None:
            version, trace, caller, flags, more = found.groups()
            if trace != _NO_TRACE and caller != _NO_SPAN and not (version == "00" and more):
                return cls(trace_id=trace, flags=flags)
        return cls()

    @property
    def traceparent(self) -> str:
        """Value of the header of the answer."""
        return f"00-{self.trace_id}-{self.span_id}-{self.flags}"

    @property
    def ids(self) -> dict[str, str]:
        """Fields of its log lines."""
        names = ("request_id", "trace_id", "span_id")
        return {name: getattr(self, name) for name in names}


def context_of(request: Request) -> RequestContext:
    """The context that the telemetry middleware gave a request."""
    return request.state.context
