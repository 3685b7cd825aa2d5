"""Memory and processor time of a process and its descendants."""

import os
import re
from pathlib import Path


def family_of(root: int) -> set[int]:
    """Process ids of a process and its descendants."""
    parents = {}
    for stat in Path("/proc").glob("[0-9]*/stat"):
        fields = _fields(stat)
        if fields:
            parents[int(stat.parent.name)] = int(fields[1])
    family = {root}
    while more := {child for child, parent in parents.items() if parent in family} - family:
        family |= more
    return family


def memory_of(root: int) -> float:
    """MB of a process and its descendants; shared memory counts once."""
    total = 0
    for process in family_of(root):
        try:
            rollup = Path(f"/proc/{process}/smaps_rollup").read_text()
        except OSError:
            continue
        total += int(re.findall(r"^Pss: +(\d+)", rollup, re.MULTILINE)[0])
    return total / 1024


def computed_by(process: int) -> float:
    """Processor seconds of one process so far; 0 once it has ended."""
    fields = _fields(Path(f"/proc/{process}/stat"))
    return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK") if fields else 0.0


def _fields(stat: Path) -> list[str]:
    """The fields of /proc/ID/stat from the state on; none once the process has ended."""
    try:
        return stat.read_text().rpartition(")")[2].split()
    except OSError:
        return []
