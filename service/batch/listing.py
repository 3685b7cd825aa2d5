"""Which files are classified: walked one by one, in the same order each time, never held."""

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass
from itertools import islice
from pathlib import Path

from meshconv3d.model.loading import FORMATS
from meshconv3d.service.batch.entries import Entry, Source, StandardInput
from meshconv3d.service.batch.local import LOCAL
from meshconv3d.service.batch.patterns import MAGIC, matches, may_match
from meshconv3d.service.batch.remote import REMOTE, is_url
from meshconv3d.service.batch.sharding import Shard

# The path that stands for standard input.
STDIN = "-"


class NotListed(ValueError):
    """There is nothing to classify where it was said to be; the message says what to do."""


@dataclass(frozen=True)
class Choice:
    """Which of the files that are found are classified. A file that was named is, whatever its
    name, if it is of the shard.

    include, exclude: patterns; with none to include, all are.
    """

    include: Sequence[str] = ()
    exclude: Sequence[str] = ()
    shard: Shard | None = None

    def fits(self, entry: Entry) -> bool:
        """Whether the patterns let a file in that was found."""
        wanted = not self.include or any(matches(entry.below, one) for one in self.include)
        return wanted and not any(matches(entry.below, one) for one in self.exclude)

    def shares(self, entry: Entry) -> bool:
        """Whether a file is of the shard."""
        return self.shard is None or self.shard.has(entry.below)


@dataclass(frozen=True)
class Place:
    """What one PATH names. find: walks it anew. root: the folder that is searched; None for one
    file. pattern: what paths below it fit."""

    path: str
    find: Callable[[], Iterable[Entry]]
    root: str | None = None
    pattern: str = "**"

    def may_find(self, folder: Path, depth: int) -> bool:
        """Whether a file of some name is found if it comes to lie in a folder of this machine, or
        as many folders below it as make `depth` names with its own."""
        if self.root is None or is_url(self.root):
            return False
        folder, root = folder.resolve(), Path(self.root).resolve()
        if not folder.is_relative_to(root):
            return False
        return may_match([*folder.relative_to(root).parts, *[None] * depth], self.pattern)


class Listing:
    """The files behind some paths: of this machine, of others by URL, standard input.

    Each time it is iterated it walks anew.
    """

    def __init__(
        self, paths: Iterable[str], choice: Choice | None = None, declared: str | None = None
    ) -> None:
        """declared: the format of standard input. Raises NotListed, with every path looked at."""
        self._choice = choice or Choice()
        self.places = [_place(path, declared) for path in paths]
        for place in self.places:
            if not any(True for _ in self._chosen(place)):
                raise NotListed(_nothing(place.path, self._choice))

    def __iter__(self) -> Iterator[Entry]:
        for place in self.places:
            yield from filter(self._choice.shares, self._chosen(place))

    def first(self, count: int) -> list[Entry]:
        """The first files, at most `count`."""
        return list(islice(self, count))

    def _chosen(self, place: Place) -> Iterable[Entry]:
        found = place.find()
        return found if place.root is None else filter(self._choice.fits, found)


def _place(path: str, declared: str | None) -> Place:
    if path == STDIN:
        return Place(path, lambda: [StandardInput(declared)])
    source: Source = REMOTE if is_url(path) else LOCAL
    try:
        kind = source.kind(path)
    except OSError as error:
        raise NotListed(f"{path} cannot be opened: {error.strerror}") from None
    if kind == "file":
        return Place(path, lambda: [source.file(path)])
    if kind == "folder":
        return Place(path, lambda: source.walk(path), path)
    if MAGIC.intersection(path):
        folder, pattern = source.split_glob(path)
        return Place(path, lambda: _fitting(source.walk(folder), pattern), folder, pattern)
    raise NotListed(f"no such file or folder: {path}")


def _fitting(entries: Iterable[Entry], pattern: str) -> Iterator[Entry]:
    # With the slash, a glob of one part means the folder itself, and not those below.
    return (entry for entry in entries if matches("/" + entry.below, "/" + pattern))


def _nothing(path: str, choice: Choice) -> str:
    if choice.include or choice.exclude:
        return f"no mesh files under {path} that --include and --exclude let in"
    return f"no mesh files under {path} (read are: {', '.join(FORMATS)})"
