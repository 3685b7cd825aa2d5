"""Globs over paths with slashes."""

from collections.abc import Sequence
from fnmatch import fnmatchcase

MAGIC = frozenset("*?[")


def matches(path: str, pattern: str) -> bool:
    """Whether a pattern fits a path: `*`, `?` and `[...]` within a name, `**` over any folders.

    A pattern without a slash is held against the name alone.
    """
    parts, patterns = path.split("/"), pattern.split("/")
    return _match(parts[-1:] if len(patterns) == 1 else parts, patterns)


def may_match(parts: Sequence[str | None], pattern: str) -> bool:
    """Whether a pattern fits a path of which some parts are not known, and None: then, whether it
    does with some name in their place."""
    return _match(parts, pattern.split("/"))


def _match(parts: Sequence[str | None], patterns: Sequence[str]) -> bool:
    if not patterns:
        return not parts
    if patterns[0] == "**":
        return any(_match(parts[i:], patterns[1:]) for i in range(len(parts) + 1))
    fits = bool(parts) and (parts[0] is None or fnmatchcase(parts[0], patterns[0]))
    return fits and _match(parts[1:], patterns[1:])


def split_glob(path: str) -> tuple[str, str]:
    """The folder above the first part with a wildcard, and the pattern below that folder."""
    parts = path.split("/")
    first = next(i for i, part in enumerate(parts) if MAGIC.intersection(part))
    folder = "/".join(parts[:first])
    return folder or ("/" if first else "."), "/".join(parts[first:])
