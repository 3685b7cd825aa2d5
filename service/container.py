"""Limits of the container that this process runs in: control groups of Linux, version 1 and 2.

A group and all groups above it bound the process. Where there are none, there is no limit.
"""

import os
from collections.abc import Iterator
from pathlib import Path

ROOT = Path("/")

# Version 1 writes a number near 2**63 where there is no limit.
NO_LIMIT = 2**60

# Memory of a worker with the shipped models, and of the front and the fork server together.
WORKER_BYTES = 200 * 2**20
SERVICE_BYTES = 400 * 2**20


def usable_cpus(root: Path = ROOT) -> int:
    """Cores that this process may use, by its affinity and by the quota of its container."""
    cores = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count()
    return max(1, int(min(cores or 1, cpu_quota(root))))


def default_workers(mesh_bytes: int, queue_bytes: int, root: Path = ROOT) -> int:
    """Workers for these cores, or fewer where the container's memory holds fewer.

    mesh_bytes: what one mesh may take in each. queue_bytes: of uploads in the front.
    """
    cpus, memory = usable_cpus(root), memory_limit(root)
    if memory is None:
        return cpus
    return max(1, min(cpus, (memory - SERVICE_BYTES - queue_bytes) // (WORKER_BYTES + mesh_bytes)))


def cpu_quota(root: Path = ROOT) -> float:
    """Processors that the container may use at a time; infinity for no limit."""
    quotas = [float("inf")]
    for group in _groups("cpu", root):
        words = _words(group / "cpu.max") or [
            *_words(group / "cpu.cfs_quota_us"),
            *_words(group / "cpu.cfs_period_us"),
        ]
        if words and words[0] not in ("max", "-1"):
            quotas.append(int(words[0]) / int(words[1]))
    return min(quotas)


def memory_limit(root: Path = ROOT) -> int | None:
    """Bytes of memory that the container may use; None for no limit."""
    limits = []
    for group in _groups("memory", root):
        for name in ("memory.max", "memory.limit_in_bytes"):
            limits += [int(word) for word in _words(group / name) if word != "max"]
    return min((limit for limit in limits if limit < NO_LIMIT), default=None)


def oom_kills(root: Path = ROOT) -> int:
    """Number of processes of the container that the kernel ended because memory ran out."""
    for group in _groups("memory", root):
        for name in ("memory.events", "memory.oom_control"):
            words = _words(group / name)
            if "oom_kill" in words:
                return int(words[words.index("oom_kill") + 1])
    return 0


def _groups(controller: str, root: Path) -> Iterator[Path]:
    """Folders of the group of this process and of those above it, the own one first."""
    try:
        groups = (root / "proc/self/cgroup").read_text().splitlines()
        mounts = (root / "proc/self/mountinfo").read_text().splitlines()
    except OSError:
        return
    # By controller; version 2 has one group for all of them, which is listed under "".
    paths = {
        name: path
        for _, names, path in (line.split(":", 2) for line in groups)
        for name in names.split(",")
    }
    for line in mounts:
        before, _, after = line.partition(" - ")
        kind, _, options = after.split(" ", 2)
        if kind not in ("cgroup", "cgroup2"):
            continue
        path = paths.get("" if kind == "cgroup2" else controller)
        if path is None or (kind == "cgroup" and controller not in options.split(",")):
            continue
        top, mount = before.split()[3:5]
        folder = root / mount.lstrip("/")
        # In a container the mount may show the own group alone, as its top.
        inner = os.path.relpath(path, top)
        own = folder if inner.startswith("..") else folder / inner
        yield from (group for group in (own, *own.parents) if group.is_relative_to(folder))


def _words(file: Path) -> list[str]:
    """Words of a file; none where there is no file."""
    try:
        return file.read_text().split()
    except OSError:
        return []
