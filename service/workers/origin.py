"""Where workers come from: imported by the process that forks them, so that each starts in a
fraction of a second, with all libraries loaded and nothing of the service's own state."""

import signal

import service.workers.tasks  # noqa: F401 (that it is loaded is the point)

# Who stops a service may signal all its processes at once. This one, and the workers, go on until
# the service has finished what it accepted: they end when it does.
signal.signal(signal.SIGTERM, signal.SIG_IGN)
