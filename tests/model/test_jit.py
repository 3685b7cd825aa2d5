"""Kernels are compiled again when their sources change, and run wherever they are installed."""

import errno
import importlib.util
import sys
from collections.abc import Iterator
from pathlib import Path
from types import ModuleType
from typing import Any

import numba.core.caching
import numba.core.config
import numpy as np
import pytest

from meshconv3d.model import jit
from meshconv3d.model.jit import kernel


def total(values):
    result = 0.0
    for value in values:
        result += value
    return result


@pytest.fixture
def cache(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> Iterator[Path]:
    """An empty folder that NUMBA_CACHE_DIR names."""
    monkeypatch.setattr(numba.core.config, "CACHE_DIR", str(tmp_path / "cache"))
    jit._warn_once.cache_clear()
    yield tmp_path / "cache"
    jit._warn_once.cache_clear()


def works(compiled: Any) -> bool:
    return compiled(np.arange(4.0)) == 6


def hits(compiled: Any) -> int:
    """How often the cache had what a call needed."""
    return sum(compiled.stats.cache_hits.values())


def write_nowhere(monkeypatch: pytest.MonkeyPatch, reason: OSError, folders: bool = True) -> None:
    """Let writing fail; with `folders`, already as a folder is looked for."""

    def refuse(*arguments: object) -> None:
        raise reason

    monkeypatch.setattr(numba.core.caching.IndexDataCacheFile, "_open_for_write", refuse)
    if folders:
        monkeypatch.setattr(numba.core.caching._CacheLocator, "ensure_cache_path", refuse)


def test_a_kernel_is_compiled_once_for_all_processes(cache: Path) -> None:
    first, second = kernel(total), kernel(total)
    assert works(first)
    assert (hits(first), first.stats.cache_path[: len(str(cache))]) == (0, str(cache))
    assert works(second)
    assert hits(second) == 1


def test_a_change_in_a_called_module_compiles_the_caller_again(
    cache: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    package = tmp_path / "package"
    package.mkdir()
    monkeypatch.setattr(jit, "PACKAGE", package)
    # Bytecode is told from that of another source by size and second alone.
    monkeypatch.setattr(sys, "dont_write_bytecode", True)
    head = "from meshconv3d.model.jit import kernel\n"
    (package / "caller.py").write_text(
        f"{head}import callee\n\nstep = callee.step\n\n@kernel\ndef run(x):\n    return step(x)\n"
    )

    def run_of(step: str) -> Any:
        (package / "callee.py").write_text(f"{head}\n@kernel\ndef step(x):\n    return x {step}\n")
        jit._kernel_sources.cache_clear()
        monkeypatch.setitem(sys.modules, "callee", load(package / "callee.py"))
        return load(package / "caller.py").run

    for step, expected, cached in (("+ 1", 11, 0), ("+ 1", 11, 1), ("* 2", 20, 0), ("* 2", 20, 1)):
        run = run_of(step)
        assert run(10) == expected
        assert hits(run) == cached
    (package / "other.py").write_text("no_kernel = True\n")
    assert run_of("* 2")(10) == 20
    jit._kernel_sources.cache_clear()


def load(path: Path) -> ModuleType:
    specification = importlib.util.spec_from_file_location(path.stem, path)
    assert specification is not None
    assert specification.loader is not None
    module = importlib.util.module_from_spec(specification)
    specification.loader.exec_module(module)
    return module


def test_without_a_folder_to_cache_in_it_is_compiled_in_every_process(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """As in a container whose user may write nowhere: numba itself would refuse to import."""
    write_nowhere(monkeypatch, PermissionError(errno.EACCES, "Permission denied"))
    compiled = kernel(total)
    assert works(compiled)
    assert compiled.stats.cache_path is None


def test_a_cache_that_can_only_be_read_is_read(
    cache: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """As in an image with a read-only file system, whose cache was filled as it was built."""
    assert works(kernel(total))
    files = sorted(cache.rglob("*"))
    write_nowhere(monkeypatch, OSError(errno.EROFS, "Read-only file system"))
    compiled = kernel(total)
    assert works(compiled)
    assert hits(compiled) == 1
    assert compiled(np.arange(4)) == 6  # of other types, for which there is none
    assert sorted(cache.rglob("*")) == files


def test_a_full_disk_is_told_once_and_stops_nothing(
    cache: Path, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    compiled, other = kernel(total), kernel(total)
    write_nowhere(monkeypatch, OSError(errno.ENOSPC, "No space left on device"), folders=False)
    assert works(compiled)
    assert works(other)
    (message,) = caplog.messages
    assert "No space left on device" in message
    assert str(cache) in message


@pytest.mark.parametrize("left", [0, 10, 100])
def test_a_damaged_cache_is_filled_again(cache: Path, left: int) -> None:
    """As a full disk or a power failure leaves it."""
    assert works(kernel(total))
    for file in cache.rglob("*.nb?"):
        file.write_bytes(file.read_bytes()[:left])
    assert works(kernel(total))
    again = kernel(total)
    assert works(again)
    assert hits(again) == 1
