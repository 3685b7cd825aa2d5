"""What the system bounds a worker process to, so that one file cannot take the machine.

Only Linux counts address space in a way that can be limited.
"""

import ctypes
import math
import resource
import sys
from pathlib import Path

# The deadline ends a worker first; this one does where the front does not live any more.
CPU_MARGIN = 2.0

# Memory that a worker may keep from one mesh to the next, to save asking the system for it again.
KEPT_BYTES = 64 * 2**20


def limit_memory(bytes_more: int) -> None:
    """Let this process take `bytes_more` of address space above what it holds now.

    An allocation beyond it fails, in Python as MemoryError. Nor does a crash leave a core file.
    """
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
    if sys.platform == "linux":
        most = _memory()[0] + bytes_more
        _, hard = resource.getrlimit(resource.RLIMIT_AS)
        if hard != resource.RLIM_INFINITY:
            most = min(most, hard)  # `ulimit -v`
        resource.setrlimit(resource.RLIMIT_AS, (most, hard))


def resident_memory() -> int:
    """Bytes of memory that this process holds; 0 where the system does not say."""
    return _memory()[1] if sys.platform == "linux" else 0


def release_memory(warm: int) -> None:
    """Give freed memory back to the system if the process holds much more than when it was warm."""
    if resident_memory() > warm + KEPT_BYTES:
        trim = getattr(ctypes.CDLL(None), "malloc_trim", None)  # of glibc
        if trim is not None:
            trim(0)


def _memory() -> tuple[int, int]:
    """Bytes of address space and of resident memory of this process."""
    size, resident = Path("/proc/self/statm").read_text().split()[:2]
    return int(size) * resource.getpagesize(), int(resident) * resource.getpagesize()


def limit_cpu(seconds: float) -> None:
    """End this process once it has computed for `seconds`, and a margin, from now on.

    The system counts over the life of a process: the limit is moved on before each task.
    """
    used = resource.getrusage(resource.RUSAGE_SELF)
    most = math.ceil(used.ru_utime + used.ru_stime + seconds + CPU_MARGIN)
    _, hard = resource.getrlimit(resource.RLIMIT_CPU)
    resource.setrlimit(resource.RLIMIT_CPU, (most, hard))
