"""The list of benchmarks, and a run of several of them as one JSON file.

Each is a module with `run(model_name) -> Findings`, which prints what it finds, and runs in a
process of its own. Those that need data, or a hundred thousand files, are commands by themselves;
they are only listed.
"""

import datetime
import importlib
import json
import os
import platform
from collections.abc import Sequence
from dataclasses import dataclass
from importlib.metadata import version
from pathlib import Path
from typing import Any

from benchmarks.figures import Findings
from benchmarks.measuring import apart
from meshconv3d.service.models import open_model

ROOT = Path(__file__).parents[1]

# In the order in which they are run.
BENCHMARKS = (
    "latency",
    "roofline",
    "training_step",
    "decimation",
    "growth",
    "formats",
    "footprint",
    "serving",
)
BY_THEMSELVES = (
    "batch",
    "paper",
    "ablation",
    "robustness",
    "evidence",
    "unknown",
    "whole",
    "baselines",
    "preparation",
    "costs",
    "few_shot",
    "alike",
)
PACKAGES = ("numpy", "numba", "onnxruntime", "torch", "libigl", "trimesh")


@dataclass
class Run:
    """Findings of one run of several benchmarks, and its environment."""

    about: dict[str, Any]
    findings: dict[str, Findings]

    def write(self, path: Path) -> None:
        values = {name: found.to_json() for name, found in self.findings.items()}
        path.write_text(json.dumps({**self.about, "benchmarks": values}, indent=1) + "\n")

    @classmethod
    def read(cls, path: Path) -> "Run":
        """Raises ValueError for a file that is none of a run, OSError where there is none."""
        try:
            about = json.loads(path.read_text())
            found = about.pop("benchmarks")
            findings = {name: Findings.from_json(values) for name, values in found.items()}
        except (ValueError, KeyError, TypeError, AttributeError) as error:
            raise ValueError(f"{path} is no result of `python -m benchmarks`") from error
        return cls(about, findings)


def run(names: Sequence[str], model_name: str) -> Run:
    """Run benchmarks by name; each prints what it finds."""
    about = environment(model_name)
    print("\n".join(f"{key}: {value}" for key, value in about.items()), flush=True)
    return Run(about, {name: apart(run_one, name, model_name) for name in names})


def run_one(name: str, model_name: str) -> Findings:
    """One benchmark, in this process."""
    findings = importlib.import_module(f"benchmarks.{name}").run(model_name)
    print(f"  yardstick: {findings.yardstick:.2f} ms", flush=True)
    return findings


def environment(model_name: str) -> dict[str, Any]:
    """Machine, versions and model of a run."""
    model = open_model(model_name)
    return {
        "date": datetime.datetime.now(datetime.UTC).date().isoformat(),
        "machine": _processor(),
        "cores": len(os.sched_getaffinity(0)),
        "load_before": round(os.getloadavg()[0], 1),
        "python": platform.python_version(),
        "packages": {name: version(name) for name in PACKAGES},
        "model": {"name": model.card.name, "sha256": model.sha256},
    }


def _processor() -> str:
    for line in Path("/proc/cpuinfo").read_text().splitlines():
        if line.startswith("model name"):
            return f"{line.partition(':')[2].strip()}, {platform.machine()}"
    return platform.machine()
