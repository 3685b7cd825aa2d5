"""What is classified: mesh files, wherever they lie."""

import sys
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Literal, Protocol


class Entry(Protocol):
    """A mesh file that was listed. Small, and fit to be sent to other processes: the bytes are
    read where they are needed."""

    @property
    def name(self) -> str:
        """As its record has it."""
        ...

    @property
    def below(self) -> str:
        """Its path from where it was found, with slashes."""
        ...

    @property
    def declared(self) -> str | None:
        """What tells its format, if anything does."""
        ...

    @property
    def local(self) -> Path | None:
        """Where it lies on this machine, if it does."""
        ...

    def size(self) -> int:
        """In bytes; 0 where that is not known before it is read."""
        ...

    def read(self) -> bytes:
        """All of it. Raises OSError."""
        ...


class Source(Protocol):
    """Where files lie: on this machine, or behind URLs."""

    def kind(self, path: str) -> Literal["file", "folder"] | None:
        """What a path names; None for nothing. Raises OSError."""
        ...

    def file(self, path: str) -> Entry:
        """The file at a path."""
        ...

    def walk(self, folder: str) -> Iterator[Entry]:
        """The files under a folder whose extension is one that is read, one by one, sorted."""
        ...

    def split_glob(self, path: str) -> tuple[str, str]:
        """A path with wildcards as the folder above the first of them, and the rest."""
        ...


@dataclass(frozen=True)
class StandardInput:
    """The one mesh that standard input holds."""

    declared: str | None
    name: str = "-"
    below: str = "-"
    local: None = None

    def size(self) -> int:
        return 0

    def read(self) -> bytes:
        return sys.stdin.buffer.read()
