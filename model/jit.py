"""How kernels are compiled: once, free of Python's lock, and kept on disk where possible."""

import logging
import os
from collections.abc import Callable
from typing import Any

from numba import njit
from numba.core.caching import CompileResultCacheImpl, FunctionCache, UserProvidedCacheLocator

log = logging.getLogger(__name__)


def kernel(function: Callable[..., Any]) -> Any:
    """Compile a function with numba; cached beside its source, or in NUMBA_CACHE_DIR.

    A cache there that may only be read, as in an image with a read-only file system, is read.
    Where there is none at all (an installation owned by someone else, no home folder), it is
    compiled anew by every process. numba's cache does not see a change in another file: a kernel
    calls only kernels of its own file.
    """
    try:
        return njit(cache=True, nogil=True)(function)
    except RuntimeError:
        compiled: Any = njit(nogil=True)(function)
    try:
        compiled._cache = _ReadOnlyCache(function)
    except RuntimeError:
        log.info("no folder to cache %s in: it is compiled at every start", function.__name__)
    return compiled


class _ReadableFolder(UserProvidedCacheLocator):
    """NUMBA_CACHE_DIR, for which numba itself would ask that it can be written to."""

    def ensure_cache_path(self) -> None:
        os.listdir(self.get_cache_path())


class _ReadOnlyCacheImpl(CompileResultCacheImpl):
    _locator_classes = [_ReadableFolder]  # noqa: RUF012 (as in its base)


class _ReadOnlyCache(FunctionCache):
    """A cache that is filled already: by the same kernels, for the same kind of processor."""

    _impl_class = _ReadOnlyCacheImpl

    def save_overload(self, sig: object, data: object) -> None:
        """Nothing, where nothing can be written."""
