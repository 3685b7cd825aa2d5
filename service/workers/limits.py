"""What the system holds a worker process to, so that one file cannot take the machine.

Only Linux counts address space in a way that can be limited.
"""

import math
import resource
import sys
from pathlib import Path

# Above the deadline by this much: who stands behind the deadline ends a worker first, and this
# only where nobody stands there any more.
CPU_MARGIN = 2.0


def limit_memory(bytes_more: int) -> None:
    """Let this process take `bytes_more` of address space above what it holds now.

    An allocation beyond it fails, in Python as MemoryError. Nor does it leave a core file.
    """
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
    if sys.platform == "linux":
        pages = int(Path("/proc/self/statm").read_text().split()[0])
        most = pages * resource.getpagesize() + bytes_more
        _, hard = resource.getrlimit(resource.RLIMIT_AS)
        if hard != resource.RLIM_INFINITY:
            most = min(most, hard)  # ulimit -v, which may only be lowered
        resource.setrlimit(resource.RLIMIT_AS, (most, most))


def limit_cpu(seconds: float) -> None:
    """End this process once it has computed for `seconds`, and a margin, from now on.

    The system counts over the life of a process: the limit is moved on before each task.
    """
    used = resource.getrusage(resource.RUSAGE_SELF)
    most = math.ceil(used.ru_utime + used.ru_stime + seconds + CPU_MARGIN)
    _, hard = resource.getrlimit(resource.RLIMIT_CPU)
    resource.setrlimit(resource.RLIMIT_CPU, (most, hard))
