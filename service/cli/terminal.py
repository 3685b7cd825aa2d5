"""What commands do alike at a terminal: text that is safe to print, and a progress bar."""

from collections.abc import Iterable, Iterator
from typing import TypeVar

Item = TypeVar("Item")


def shown(text: str) -> str:
    """Text as it is, for rich: no markup, and nothing in it commands the terminal."""
    from rich.markup import escape

    return escape(printable(text))


def printable(text: str) -> str:
    """Text of which nothing commands the terminal."""
    return "".join(char if char.isprintable() else "\ufffd" for char in text)


def with_progress(items: Iterable[Item], total: int) -> Iterator[Item]:
    """The items as they come, under a bar on stderr; no bar for one, or without a terminal."""
    from rich.console import Console
    from rich.progress import track

    console = Console(stderr=True)
    yield from track(
        items,
        "Classifying",
        total,
        console=console,
        transient=True,
        disable=total == 1 or not console.is_terminal,
    )
