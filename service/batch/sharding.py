"""A part of the files, the same one whoever asks: so that several machines share them out."""

import hashlib
import re
from dataclasses import dataclass


@dataclass(frozen=True)
class Shard:
    """Part `number`, from 1, of `count`."""

    number: int
    count: int

    @classmethod
    def parse(cls, text: str) -> "Shard":
        """From the form "2/8". Raises ValueError."""
        found = re.fullmatch(r"(\d+)/(\d+)", text)
        if found is None or not 1 <= int(found[1]) <= int(found[2]):
            raise ValueError(f"{text!r} is no part of a whole: give one from 1/N to N/N, as 2/8")
        return cls(int(found[1]), int(found[2]))

    def has(self, below: str) -> bool:
        """Whether a file is of this part, by its path from where it was found."""
        digest = hashlib.sha256(below.encode()).digest()
        return int.from_bytes(digest[:8], "big") % self.count == self.number - 1
