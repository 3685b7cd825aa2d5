"""How kernels are compiled: once, free of Python's lock, and kept on disk where possible."""

import logging
from collections.abc import Callable
from typing import Any

from numba import njit

log = logging.getLogger(__name__)


def kernel(function: Callable[..., Any]) -> Any:
    """Compile a function with numba; cached beside its source, or in NUMBA_CACHE_DIR.

    Where no cache can be written (an installation owned by someone else, no home folder), it is
    compiled anew by every process. numba's cache does not see a change in another file: a kernel
    calls only kernels of its own file.
    """
    try:
        return njit(cache=True, nogil=True)(function)
    except RuntimeError:
        log.info("no folder to cache %s in: it is compiled at every start", function.__name__)
        return njit(nogil=True)(function)
