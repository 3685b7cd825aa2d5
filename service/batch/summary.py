"""What became of all files, in numbers."""

from collections import Counter
from dataclasses import dataclass, field


@dataclass
class Tally:
    """classified: with an answer. refused: by fault. earlier: those of both that an earlier run
    has left."""

    classified: int = 0
    refused: Counter[str] = field(default_factory=Counter)
    earlier: int = 0

    def add(self, fault: str | None) -> None:
        """Count one file. fault: why it was not classified; None if it was."""
        if fault is None:
            self.classified += 1
        else:
            self.refused[fault] += 1

    @property
    def files(self) -> int:
        """All of them."""
        return self.classified + self.refused.total()

    def reasons(self) -> str:
        """The faults, the commonest first: "no-faces 2, deadline 1"."""
        return ", ".join(f"{fault} {count}" for fault, count in self.refused.most_common())
