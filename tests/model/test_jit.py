"""Kernels run wherever the package is installed."""

from pathlib import Path

import numba.core.caching
import numba.core.config
import numpy as np
import pytest

from meshconv3d.model.jit import kernel


def total(values):
    result = 0.0
    for value in values:
        result += value
    return result


def test_a_kernel_is_compiled_and_cached():
    compiled = kernel(total)
    assert compiled(np.arange(4.0)) == 6
    assert compiled.stats.cache_path


def test_without_a_folder_to_cache_in_it_is_compiled_anew(monkeypatch: pytest.MonkeyPatch):
    """As in a container whose user may write nowhere: numba itself would refuse to import."""
    monkeypatch.setattr(numba.core.caching.CacheImpl, "_locator_classes", [])
    compiled = kernel(total)
    assert compiled(np.arange(4.0)) == 6
    assert compiled.stats.cache_path is None


def test_a_cache_that_can_only_be_read_is_read(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    """As in an image with a read-only file system, whose cache was filled as it was built."""
    monkeypatch.setattr(numba.core.config, "CACHE_DIR", str(tmp_path))
    filled = kernel(total)
    filled(np.arange(4.0))
    files = sorted(tmp_path.rglob("*"))
    monkeypatch.setattr(numba.core.caching.CacheImpl, "_locator_classes", [])
    compiled = kernel(total)
    assert compiled(np.arange(4.0)) == 6
    assert compiled.stats.cache_hits
    assert compiled(np.arange(4)) == 6  # of other types, for which there is none
    assert sorted(tmp_path.rglob("*")) == files


def test_an_empty_cache_that_can_only_be_read(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    monkeypatch.setattr(numba.core.config, "CACHE_DIR", str(tmp_path))
    monkeypatch.setattr(numba.core.caching.CacheImpl, "_locator_classes", [])
    assert kernel(total)(np.arange(4.0)) == 6
