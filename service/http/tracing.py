"""Where a request stands in a trace that others began (W3C Trace Context)."""

import re
import secrets
from dataclasses import dataclass

# version 00: trace, caller's span, flags; later versions may append more.
_TRACEPARENT = re.compile(r"(?!ff)([0-9a-f]{2})-([0-9a-f]{32})-([0-9a-f]{16})-([0-9a-f]{2})(-.*)?")
_NO_TRACE, _NO_SPAN = "0" * 32, "0" * 16


@dataclass(frozen=True)
class Trace:
    """One request's own span. trace: 32 hexadecimal digits; span: 16; flags: 2."""

    trace: str
    span: str
    flags: str

    @classmethod
    def of(cls, traceparents: list[str]) -> "Trace":
        """A span below the caller's, or where no valid one is given, in a trace of its own."""
        span = secrets.token_hex(8)
        found = _TRACEPARENT.fullmatch(traceparents[0]) if len(traceparents) == 1 else None
        if found is not None:
            version, trace, caller, flags, more = found.groups()
            if trace != _NO_TRACE and caller != _NO_SPAN and not (version == "00" and more):
                return cls(trace, span, flags)
        return cls(secrets.token_hex(16), span, "00")

    @property
    def traceparent(self) -> str:
        """It as a header's value."""
        return f"00-{self.trace}-{self.span}-{self.flags}"
