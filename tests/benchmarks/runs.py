"""Runs that were never run."""

from benchmarks.figures import Figure, Findings
from benchmarks.suite import Run


def findings(yardstick: float = 20.0, /, **figures: tuple[float, str]) -> Findings:
    """Figures by name, as (value, unit)."""
    return Findings(yardstick, {name: Figure(*figure) for name, figure in figures.items()})


def run_of(**benchmarks: Findings) -> Run:
    """A run of these benchmarks."""
    return Run({"date": "2026-01-01"}, benchmarks)
