"""Kernels run wherever the package is installed."""

import numba.core.caching
import numpy as np
import pytest

from model.kernels import kernel


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
