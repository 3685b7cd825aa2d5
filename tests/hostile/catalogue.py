"""What a hostile file is."""

from collections.abc import Callable
from dataclasses import dataclass


@dataclass(frozen=True)
class HostileFile:
    """One file, made when it is asked for.

    name: the file name that is declared with it.
    fault: the slug that reading it must end with; None where it must load.
    """

    name: str
    make: Callable[[], bytes]
    fault: str | None

    @property
    def data(self) -> bytes:
        return self.make()


class Catalogue(dict[str, HostileFile]):
    """The hostile files of one family, by a title each, under the name of a harmless one."""

    def __init__(self, name: str) -> None:
        super().__init__()
        self._name = name

    def add(
        self,
        title: str,
        data: bytes | Callable[[], bytes],
        fault: str | None,
        name: str | None = None,
    ) -> None:
        if title in self:
            raise ValueError(f"there are two files called {title!r}")
        make = data if callable(data) else lambda: data
        self[title] = HostileFile(name or self._name, make, fault)


def replaced(data: bytes, old: bytes, new: bytes) -> bytes:
    """`data` with one thing in it changed, which must be there."""
    if old not in data:
        raise ValueError(f"{old!r} is not in the file")
    return data.replace(old, new, 1)
