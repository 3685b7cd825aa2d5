"""Findings of a benchmark: figures, each a cost, printed and kept as JSON.

Every figure is a cost: less is better. Milliseconds are compared between two runs as shares of
each run's own yardstick, all other units as they are.
"""

from dataclasses import asdict, dataclass, field
from typing import Any

MILLISECONDS = "ms"
YARDSTICKS = "yardsticks"


@dataclass(frozen=True)
class Figure:
    """One measured cost. goal: the most that it should be, in the same unit."""

    value: float
    unit: str
    goal: float | None = None

    @property
    def met(self) -> bool:
        return self.goal is None or self.value <= self.goal


@dataclass
class Findings:
    """The figures of one benchmark by name, and tables for plots; `yardstick` is in ms."""

    yardstick: float
    figures: dict[str, Figure] = field(default_factory=dict)
    tables: dict[str, Any] = field(default_factory=dict)

    def add(self, name: str, value: float, unit: str, goal: float | None = None) -> None:
        """Keep a figure, and print it."""
        self.figures[name] = figure = Figure(float(f"{value:.4g}"), unit, goal)
        print(line(name, figure), flush=True)

    def cost(self, name: str, milliseconds: float, goal: float | None = None) -> None:
        """Keep and print a time in yardsticks; the goal is in yardsticks too."""
        self.add(name, milliseconds / self.yardstick, YARDSTICKS, goal)

    def to_json(self) -> dict[str, Any]:
        return asdict(self)

    @classmethod
    def from_json(cls, values: dict[str, Any]) -> "Findings":
        figures = {name: Figure(**figure) for name, figure in values["figures"].items()}
        return cls(values["yardstick"], figures, values["tables"])


def line(name: str, figure: Figure) -> str:
    """A figure as a line of text."""
    text = f"  {name:44}{figure.value:>10.4g} {figure.unit}"
    if figure.goal is None:
        return text
    return f"{text:72} goal {figure.goal:g}: {'met' if figure.met else 'missed'}"


def heading(text: str) -> None:
    print(f"\n{text}", flush=True)
