"""Limits of a container, in made-up trees of files and in a real control group."""

import os
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

from meshconv3d.service.container import (
    SERVICE_BYTES,
    WORKER_BYTES,
    cpu_quota,
    default_workers,
    memory_limit,
    oom_kills,
    usable_cpus,
)
from meshconv3d.service.settings import Settings
from tests.commands import environment
from tests.processes import until

GIB = 2**30
V1 = """\
35 31 0:32 {top} /sys/fs/cgroup/memory rw - cgroup cgroup rw,memory
32 31 0:29 {top} /sys/fs/cgroup/cpu,cpuacct rw - cgroup cgroup rw,cpu,cpuacct
"""
V2 = "41 31 0:38 {top} /sys/fs/cgroup rw,relatime shared:9 - cgroup2 cgroup2 rw,nsdelegate\n"


def tree(root: Path, groups: str, mounts: str, files: dict[str, str]) -> Path:
    """A file system with what the kernel says of this process, and with these files."""
    contents = {"proc/self/cgroup": groups, "proc/self/mountinfo": mounts}
    contents |= {f"sys/fs/cgroup/{name}": content for name, content in files.items()}
    for name, content in contents.items():
        path = root / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(content)
    return root


def v2(root: Path, files: dict[str, str], group: str = "/a/b", top: str = "/") -> Path:
    return tree(root, f"0::{group}\n", V2.format(top=top), files)


def v1(root: Path, files: dict[str, str], group: str = "/a/b", top: str = "/") -> Path:
    groups = f"4:memory:{group}\n2:cpu,cpuacct:{group}\n1:name=systemd:/x\n0::/\n"
    return tree(root, groups, V1.format(top=top), files)


@pytest.mark.parametrize(
    ("own", "above", "expected"),
    [
        ("50000 100000", "max 100000", 0.5),
        ("max 100000", "150000 100000", 1.5),
        ("300000 100000", "20000 10000", 2.0),
        ("max 100000", "max 100000", float("inf")),
    ],
)
def test_the_smallest_cpu_quota_of_version_2_holds(
    tmp_path: Path, own: str, above: str, expected: float
) -> None:
    assert cpu_quota(v2(tmp_path, {"a/b/cpu.max": own, "a/cpu.max": above})) == expected


@pytest.mark.parametrize(("quota", "expected"), [("50000", 0.5), ("-1", float("inf"))])
def test_the_cpu_quota_of_version_1(tmp_path: Path, quota: str, expected: float) -> None:
    names = ("cfs_quota_us", "cfs_period_us")
    files = {
        f"cpu,cpuacct/a/b/cpu.{name}": f"{value}\n"
        for name, value in zip(names, (quota, "100000"), strict=True)
    }
    assert cpu_quota(v1(tmp_path, files)) == expected


def test_memory_limits_of_both_versions(tmp_path: Path) -> None:
    files = {"a/b/memory.max": "max\n", "a/memory.max": f"{GIB}\n", "memory.max": f"{2 * GIB}\n"}
    assert memory_limit(v2(tmp_path / "2", files)) == GIB
    files = {
        "memory/a/b/memory.limit_in_bytes": f"{GIB}\n",
        "memory/memory.limit_in_bytes": "9223372036854771712\n",
    }
    assert memory_limit(v1(tmp_path / "1", files)) == GIB


@pytest.mark.parametrize(
    ("group", "top"),
    [("/docker/abc", "/docker/abc"), ("/", "/"), ("/../../x", "/"), ("/docker/abc", "/other")],
)
def test_in_a_container_the_mount_shows_the_own_group_alone(
    tmp_path: Path, group: str, top: str
) -> None:
    files = {"cpu.max": "50000 100000", "memory.max": str(GIB)}
    root = v2(tmp_path, files, group, top)
    assert (cpu_quota(root), memory_limit(root)) == (0.5, GIB)


def test_without_groups_there_is_no_limit(tmp_path: Path) -> None:
    assert (cpu_quota(tmp_path), memory_limit(tmp_path)) == (float("inf"), None)
    assert usable_cpus(tmp_path) == len(os.sched_getaffinity(0))


def test_workers_are_as_many_as_quota_and_memory_hold(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(os, "sched_getaffinity", lambda _: range(8))

    def workers(cpu: str, memory: str) -> int:
        return default_workers(GIB, GIB, v2(tmp_path, {"cpu.max": cpu, "memory.max": memory}, "/"))

    assert workers("max 100000", "max") == 8
    assert workers("250000 100000", "max") == 2
    assert workers("50000 100000", "max") == 1
    assert workers("max 100000", str(SERVICE_BYTES + GIB + 3 * (WORKER_BYTES + GIB))) == 3
    assert workers("max 100000", str(GIB)) == 1


def test_a_setting_goes_before_the_container(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("meshconv3d.service.settings.default_workers", lambda *_: 1)
    assert Settings().workers == 1
    assert Settings(workers=3).workers == 3


def test_kills_are_counted_in_the_own_group(tmp_path: Path) -> None:
    events = "low 0\nhigh 0\nmax 9\noom 2\noom_kill {}\n"
    files = {"a/b/memory.events": events.format(3), "a/memory.events": events.format(7)}
    assert oom_kills(v2(tmp_path / "2", files)) == 3
    control = "oom_kill_disable 0\nunder_oom 0\noom_kill 4\n"
    assert oom_kills(v1(tmp_path / "1", {"memory/a/b/memory.oom_control": control})) == 4
    assert oom_kills(tmp_path) == 0


@pytest.fixture
def group() -> Iterator[Path]:
    """A memory group of version 1 that the test can limit."""
    path = Path(f"/sys/fs/cgroup/memory/meshconv3d-test-{os.getpid()}")
    try:
        path.mkdir()
    except OSError as error:
        pytest.skip(f"needs root and control groups of version 1: {error}")
    yield path
    until(lambda: not (path / "tasks").read_text())
    path.rmdir()


OUT_OF_MEMORY = """
import sys
from pathlib import Path

Path(sys.argv[1], "tasks").write_text("0")
from meshconv3d.model.loading import Limits
from meshconv3d.service.models import ModelFile
from meshconv3d.service.workers import Setup, Task, WorkerPool

pool = WorkerPool(Setup([ModelFile.read(sys.argv[2])], Limits(), 2**33, 60.0), workers=1)
pool.start()
text = b"v 0 0 0\\nv 1 0 0\\nv 0 1 0\\n"
large = text + b"f 1 2 3\\n" * 3_000_000
Path(sys.argv[1], "memory.limit_in_bytes").write_text(sys.argv[3])
print(pool.submit(Task("tiny", large, None, "obj")).exception().fault)
print(pool.submit(Task("tiny", text, None, "obj")).exception().fault)
pool.close()
"""


def test_a_worker_that_the_kernel_ends_for_memory_is_told_as_that(
    group: Path, model_file: Path
) -> None:
    """The front lives on: the kernel chooses the worker."""
    command = [sys.executable, "-c", OUT_OF_MEMORY, group, model_file, str(350 * 2**20)]
    done = subprocess.run(
        list(map(str, command)), capture_output=True, text=True, env=environment(), timeout=120
    )
    assert done.stdout.split() == ["too-much-memory", "no-faces"], done.stderr
