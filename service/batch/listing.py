"""Listing of the files to classify: one by one, in the same order each time, never all at once."""

import hashlib
import re
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass
from fnmatch import fnmatchcase
from itertools import islice
from pathlib import Path

from meshconv3d.model.errors import MeshError
from meshconv3d.model.loading import FORMATS, extension, has_mesh_name, has_other_format
from meshconv3d.service.batch.files import (
    ArchivedFile,
    File,
    StandardInput,
    file_at,
    is_folder,
    is_url,
    members,
    walk,
)

ARCHIVE = "zip"
# The path that stands for standard input.
STDIN = "-"
WILDCARDS = frozenset("*?[")


class NotListed(ValueError):
    """Error of a path without files to classify; the message says what to do."""


@dataclass(frozen=True)
class Shard:
    """Part `number`, from 1, of `count`. It depends on the paths of files alone, so that several
    machines can share the files without talking."""

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


@dataclass(frozen=True)
class Choice:
    """Selection among the files of folders; of files that were named, only the shard selects.

    include, exclude: patterns; with none to include, all are. shard: None for all.
    """

    include: Sequence[str] = ()
    exclude: Sequence[str] = ()
    shard: Shard | None = None

    def fits(self, file: File) -> bool:
        """Whether the patterns select a file of a folder."""
        wanted = not self.include or any(matches(file.below, one) for one in self.include)
        return wanted and not any(matches(file.below, one) for one in self.exclude)

    def shares(self, file: File) -> bool:
        """Whether a file is of the shard."""
        return self.shard is None or self.shard.has(file.below)


@dataclass(frozen=True)
class Place:
    """Files behind one PATH. find: lists them anew. root: the folder that is searched; None for one
    file. pattern: fits their paths below it."""

    path: str
    find: Callable[[], Iterable[File]]
    root: str | None = None
    pattern: str = "**"

    def may_find(self, folder: Path, depth: int) -> bool:
        """Whether a new file, `depth` names below a folder of this machine, could be found."""
        if self.root is None or is_url(self.root):
            return False
        folder, root = folder.resolve(), Path(self.root).resolve()
        if not folder.is_relative_to(root):
            return False
        parts = [*folder.relative_to(root).parts, *[None] * depth]
        return _match(parts, self.pattern.split("/"))


class Listing:
    """The files behind some paths: of this machine, of others by URL, standard input.

    Each time it is iterated it walks anew.
    """

    def __init__(
        self, paths: Iterable[str], choice: Choice | None = None, declared: str | None = None
    ) -> None:
        """declared: the format of files that are named, and of standard input. Raises NotListed,
        with every path looked at."""
        self._choice = choice or Choice()
        self.places = [_place(path, declared) for path in paths]
        for place in self.places:
            others: Counter[str] = Counter()
            if not any(True for _ in self._chosen(place, others)):
                raise NotListed(_nothing(place.path, self._choice, others))

    def __iter__(self) -> Iterator[File]:
        return self.files(Counter())

    def files(self, others: Counter[str]) -> Iterator[File]:
        """The files; of other 3D formats in the same folders, it counts each by its extension."""
        for place in self.places:
            yield from filter(self._choice.shares, self._chosen(place, others))

    def first(self, count: int) -> list[File]:
        """The first files, at most `count`."""
        return list(islice(self, count))

    def _chosen(self, place: Place, others: Counter[str]) -> Iterator[File]:
        named = place.root is None
        for file in _unpacked(place):
            if not named and not self._choice.fits(file):
                continue
            if has_mesh_name(file.below) or (named and not isinstance(file, ArchivedFile)):
                yield file
            elif has_other_format(file.below):
                others["." + extension(file.below)] += self._choice.shares(file)


def _unpacked(place: Place) -> Iterator[File]:
    """The files of a place, with the members of archives in place of the archives.

    An archive that cannot be read or holds no mesh stays itself, so that its result says why.
    """
    for file in place.find():
        found = [file]
        if extension(file.below) == ARCHIVE:
            with suppress(MeshError, OSError):
                found = members(file) or found
        yield from found


def told(others: Counter[str]) -> str:
    """Files of other formats in words: "12 files of other formats: .fbx 9, .step 3"."""
    pairs = sorted(others.items(), key=lambda pair: (-pair[1], pair[0]))
    names = ", ".join(f"{name} {count}" for name, count in pairs)
    files = "file" if others.total() == 1 else "files"
    return f"{others.total()} {files} of other formats: {names}"


def matches(path: str, pattern: str) -> bool:
    """Whether a pattern fits a path: `*`, `?` and `[...]` within a name, `**` over any folders.

    A pattern without a slash is held against the name alone.
    """
    parts, patterns = path.split("/"), pattern.split("/")
    return _match(parts[-1:] if len(patterns) == 1 else parts, patterns)


def _match(parts: Sequence[str | None], patterns: Sequence[str]) -> bool:
    """Whether patterns fit the parts of a path; None is a part that may have any name."""
    if not patterns:
        return not parts
    if patterns[0] == "**":
        return any(_match(parts[i:], patterns[1:]) for i in range(len(parts) + 1))
    fits = bool(parts) and (parts[0] is None or fnmatchcase(parts[0], patterns[0]))
    return fits and _match(parts[1:], patterns[1:])


def _place(path: str, declared: str | None) -> Place:
    if path == STDIN:
        return Place(path, lambda: [StandardInput(STDIN, STDIN, declared)])
    try:
        folder = is_folder(path)
    except OSError as error:
        raise NotListed(f"{path} cannot be opened: {error.strerror}") from None
    if folder:
        return Place(path, lambda: walk(path), path)
    if folder is not None:
        return Place(path, lambda: [file_at(path, declared)])
    if archived := _archived(path):
        return Place(path, lambda: [archived])
    if WILDCARDS.intersection(path):
        root, pattern = _split_glob(path)
        return Place(path, lambda: _fitting(walk(root), pattern), root, pattern)
    raise NotListed(f"no such file or folder: {path}")


def _archived(path: str) -> File | None:
    """The mesh file that is named as one in a ZIP archive, by ARCHIVE/FILE."""
    found = re.fullmatch(r"(.*?\.zip)/(.+)", path, re.IGNORECASE | re.DOTALL)
    with suppress(MeshError, OSError):
        if found and is_folder(found[1]) is False:
            return next((file for file in members(file_at(found[1])) if file.name == path), None)
    return None


def _split_glob(path: str) -> tuple[str, str]:
    """The folder above the first part with a wildcard, and the pattern below that folder."""
    if is_url(path):
        protocol, _, rest = path.partition("://")
        inner, chain, outer = rest.partition("::")
        folder, pattern = _split_glob(inner)
        return f"{protocol}://{folder.removeprefix('.')}{chain}{outer}", pattern
    parts = path.split("/")
    first = next(i for i, part in enumerate(parts) if WILDCARDS.intersection(part))
    folder = "/".join(parts[:first])
    return folder or ("/" if first else "."), "/".join(parts[first:])


def _fitting(files: Iterable[File], pattern: str) -> Iterator[File]:
    # With the slash, a glob of one part means the folder itself, and not those below.
    return (file for file in files if matches("/" + file.below, "/" + pattern))


def _nothing(path: str, choice: Choice, others: Counter[str]) -> str:
    if choice.include or choice.exclude:
        return f"no mesh files under {path} that --include and --exclude let in"
    also = f"; there are {told(others)}" if others else ""
    return f"no mesh files under {path} (read are: {', '.join(FORMATS)}){also}"
