"""Size of an installation and time until it serves: `python -m benchmarks run footprint`.

Installs the package as a user does, with pip into a new virtual environment, which takes minutes
and the network where pip has nothing in its cache.
"""

import subprocess
import sys
import tempfile
from pathlib import Path

from benchmarks.figures import Findings, heading
from benchmarks.measuring import best, yardstick
from benchmarks.running_service import service
from benchmarks.suite import ROOT

# Seconds until a service is ready, its files in the disk's cache.
READY = 3.0
STARTS = 5


def run(model_name: str) -> Findings:
    """Measure and print; the model that is served, by name or file."""
    findings = Findings(best({"yardstick": yardstick()})["yardstick"])
    heading("Start and size")
    findings.add("serve ready", min(_seconds_to_ready(model_name)), "s", READY)
    with tempfile.TemporaryDirectory() as folder:
        environment = Path(folder) / "environment"
        _run(sys.executable, "-m", "venv", str(environment))
        empty = megabytes(environment)
        _run(str(environment / "bin" / "pip"), "install", str(ROOT))
        findings.add("base install", megabytes(environment) - empty, "MB")
        wheels = Path(folder) / "wheels"
        _run(sys.executable, "-m", "pip", "wheel", "--no-deps", "-w", str(wheels), str(ROOT))
        findings.add("wheel", megabytes(wheels), "MB")
    return findings


def _seconds_to_ready(model_name: str) -> list[float]:
    """Seconds of several starts; the first fills the disk's cache."""
    seconds = []
    for _ in range(STARTS):
        with service(model_name) as started:
            seconds.append(started.ready_after)
    return seconds


def megabytes(folder: Path) -> float:
    """Size of all files under a folder, without links."""
    files = (path for path in folder.rglob("*") if path.is_file() and not path.is_symlink())
    return sum(path.stat().st_size for path in files) / 1e6


def _run(*command: str) -> None:
    subprocess.run(command, check=True, stdout=subprocess.DEVNULL, cwd=ROOT)
