"""Comparison of two runs: figures that became worse by more than the tolerance."""

from collections.abc import Iterator
from dataclasses import dataclass

from benchmarks.figures import MILLISECONDS
from benchmarks.suite import Run


@dataclass(frozen=True)
class Change:
    """One figure in two runs. ratio: the second over the first; of times, in yardsticks."""

    name: str
    ratio: float

    def is_worse(self, tolerance: float) -> bool:
        return self.ratio > 1 + tolerance


def changes(before: Run, after: Run) -> Iterator[Change]:
    """Every figure that both runs have."""
    for benchmark, first in before.findings.items():
        second = after.findings.get(benchmark)
        if second is None:
            continue
        for name, old in first.figures.items():
            new = second.figures.get(name)
            if new is None or new.unit != old.unit or old.value <= 0:
                continue
            ratio = new.value / old.value
            if old.unit == MILLISECONDS:
                ratio *= first.yardstick / second.yardstick
            yield Change(f"{benchmark}: {name}", ratio)


def compare(before: Run, after: Run, tolerance: float) -> bool:
    """Print every figure that both runs have; returns whether none became worse.

    Raises ValueError where they have none in common.
    """
    found = list(changes(before, after))
    if not found:
        raise ValueError("the two runs have no figure in common")
    worse = [change for change in found if change.is_worse(tolerance)]
    print(f"{'after over before; times in yardsticks of their own run':68}    ratio")
    for change in found:
        mark = "  worse" if change in worse else ""
        print(f"  {change.name:66}{change.ratio:>9.3f}{mark}")
    print(f"{len(worse)} of {len(found)} worse by more than {tolerance:.0%}")
    return not worse
