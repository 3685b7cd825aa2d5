"""Compilation of kernels with numba: without the interpreter's lock, and cached on disk.

A kernel may call kernels of other modules. numba's own cache compares the source of one file only,
and would run outdated machine code of a callee in another. The stamp of this cache covers all
modules of the package that define kernels; constants of kernels must be in such modules, too.
"""

import hashlib
import logging
import os
from collections.abc import Callable
from contextlib import suppress
from functools import cache
from pathlib import Path
from typing import Any

from numba import njit
from numba.core.caching import (
    CompileResultCacheImpl,
    FunctionCache,
    InTreeCacheLocator,
    UserProvidedCacheLocator,
    UserWideCacheLocator,
)

log = logging.getLogger(__name__)

PACKAGE = Path(__file__).parent


def kernel(function: Callable[..., Any]) -> Any:
    """Compile a function at its first call, for the types of the arguments.

    The machine code is cached in NUMBA_CACHE_DIR, beside the source, or in the user's cache folder:
    the first that is writable. NUMBA_CACHE_DIR need only be readable, as in an image with a
    read-only file system. Without a cache, every process compiles its kernels.
    """
    compiled: Any = njit(nogil=True)(function)
    try:
        # What njit(cache=True) does, with another cache.
        compiled._cache = _KernelCache(function)
    except RuntimeError:
        log.info("no folder to cache %s in: it is compiled at every start", function.__name__)
    return compiled


def inlined(function: Callable[..., Any]) -> Any:
    """Inline a function into the kernels that call it, where a call would cost more than it."""
    return njit(inline="always")(function)


@cache
def _kernel_sources(package: Path) -> bytes:
    """Hash of all modules under a folder that define kernels."""
    sources = (path.read_bytes() for path in sorted(package.rglob("*.py")))
    return hashlib.sha256(b"".join(text for text in sources if b"@kernel" in text)).digest()


class _Stamped:
    """A cache locator whose stamp covers the callees in other modules."""

    def get_source_stamp(self) -> tuple[object, bytes]:
        return super().get_source_stamp(), _kernel_sources(PACKAGE)  # type: ignore[misc]


class _GivenFolder(_Stamped, UserProvidedCacheLocator):
    def ensure_cache_path(self) -> None:
        try:
            super().ensure_cache_path()
        except OSError:
            os.listdir(self.get_cache_path())


class _SourceFolder(_Stamped, InTreeCacheLocator):
    pass


class _UserFolder(_Stamped, UserWideCacheLocator):
    pass


class _KernelCacheImpl(CompileResultCacheImpl):
    _locator_classes = [_GivenFolder, _SourceFolder, _UserFolder]  # noqa: RUF012 (as in its base)


class _KernelCache(FunctionCache):
    """Cache without failures: entries that cannot be read or written are compiled again."""

    _impl_class = _KernelCacheImpl

    def load_overload(self, sig: object, target_context: object) -> Any:
        try:
            return super().load_overload(sig, target_context)
        except Exception as error:  # a damaged file raises anything that unpickling can
            log.info("dropping what is cached of %s: %r", self._py_func.__name__, error)
            with suppress(OSError):
                self.flush()
            return None

    def save_overload(self, sig: object, data: object) -> None:
        try:
            super().save_overload(sig, data)
        except Exception as error:
            _warn_once(self.cache_path, str(error))


@cache
def _warn_once(folder: str, reason: str) -> None:
    log.warning("cannot cache kernels in %s (%s): they are compiled at every start", folder, reason)
