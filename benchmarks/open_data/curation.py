"""The tables of the curation, and the class that they give each mesh."""

import csv
from collections import Counter
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from pathlib import Path

TABLES = Path(__file__).parent
SETS = {"objects": "open_objects", "parts": "open_parts"}
SPLITS = ("train", "val", "test", "authors")
LEAST = 5  # meshes to train on, of each class that is trained


class CurationError(ValueError):
    """Tables that contradict each other or the data."""


@dataclass(frozen=True)
class OpenMesh:
    """One row of a data set's table."""

    folder: str
    file: str
    split: str
    fine_class: str
    source: str
    origin: str
    licence: str
    author: str
    repo: str


@dataclass(frozen=True)
class CuratedMesh:
    """A mesh with the class that the curation gives it; `held_out`: of a class never trained on."""

    mesh: OpenMesh
    label: str
    held_out: bool


@dataclass(frozen=True)
class OpenClass:
    """A row of classes.csv."""

    held_out: bool
    few_shot: bool
    unknown: bool
    note: str


@dataclass(frozen=True)
class Curation:
    """The tables of one set. An empty class means left out."""

    folders: dict[tuple[str, str], str]
    moves: dict[tuple[str, str], str]
    drops: frozenset[tuple[str, str]]
    classes: dict[str, OpenClass]

    @classmethod
    def read(cls, folder: Path) -> "Curation":
        """Read the tables in a folder."""
        return cls(
            folders={
                (r["folder"], r["fine_class"]): r["class"]
                for r in read_table(folder / "folders.csv")
            },
            moves={(r["folder"], r["file"]): r["class"] for r in read_table(folder / "moves.csv")},
            drops=frozenset((r["folder"], r["file"]) for r in read_table(folder / "drops.csv")),
            classes={
                r["class"]: OpenClass(
                    held_out=r["use"] == "held_out",
                    few_shot=r["few_shot"] == "yes",
                    unknown=r["unknown"] == "yes",
                    note=r["note"],
                )
                for r in read_table(folder / "classes.csv")
            },
        )

    def label(self, mesh: OpenMesh) -> str:
        """The class of a mesh, or "" if it is left out.

        A single file's row counts before that of its fine class, and that before its folder's.
        """
        key = (mesh.folder, mesh.file)
        if key in self.drops:
            return ""
        if key in self.moves:
            return self.moves[key]
        for fine_class in (mesh.fine_class, ""):
            if (mesh.folder, fine_class) in self.folders:
                return self.folders[mesh.folder, fine_class]
        raise CurationError(f"folders.csv lacks the folder {mesh.folder}")

    def apply(self, meshes: Iterable[OpenMesh]) -> list[CuratedMesh]:
        """Give every mesh its class, sorted by class and file, without those left out.

        Raises CurationError if the tables contradict each other or the meshes.
        """
        meshes = list(meshes)
        labelled = [(mesh, self.label(mesh)) for mesh in meshes]
        if unlisted := sorted({label for _, label in labelled if label} - set(self.classes)):
            raise CurationError(f"classes.csv lacks {', '.join(unlisted)}")
        curated = [CuratedMesh(m, c, self.classes[c].held_out) for m, c in labelled if c]
        if wrong := [*self._strays(meshes), *self._misfits(curated)]:
            raise CurationError("; ".join(wrong))
        return sorted(curated, key=lambda c: (c.label, c.mesh.file))

    def _strays(self, meshes: list[OpenMesh]) -> Iterator[str]:
        """Rows of the tables that are of no mesh."""
        files = {(mesh.folder, mesh.file) for mesh in meshes}
        folders = {(m.folder, fine) for m in meshes for fine in (m.fine_class, "")}
        yield from (f"no folder {'/'.join(key)}" for key in sorted(self.folders.keys() - folders))
        yield from (f"no file {'/'.join(key)} to move" for key in sorted(self.moves.keys() - files))
        yield from (f"no file {'/'.join(key)} to drop" for key in sorted(self.drops - files))
        both = sorted(self.drops & self.moves.keys())
        yield from (f"{'/'.join(key)} is moved and dropped" for key in both)

    def _misfits(self, curated: list[CuratedMesh]) -> Iterator[str]:
        """Classes that are too small, files of one name, licences that nobody has approved."""
        trained = Counter(c.label for c in curated if c.mesh.split == "train")
        for label, about in self.classes.items():
            if not about.held_out and trained[label] < LEAST:
                yield f"class {label} has {trained[label]} meshes to train on, fewer than {LEAST}"
        names = Counter((c.label, c.mesh.file) for c in curated)
        yield from (f"class {label} has two {file}" for (label, file), n in names.items() if n > 1)
        unknown = {c.mesh.licence for c in curated} - {
            row["licence"] for row in read_table(TABLES / "licences.csv")
        }
        yield from (f"licences.csv lacks the licence {licence}" for licence in sorted(unknown))


def read_meshes(path: Path) -> list[OpenMesh]:
    """Read the table of a data set."""
    return [
        OpenMesh(
            folder=row["class"],
            **{
                name: row[name]
                for name in (
                    "file",
                    "split",
                    "fine_class",
                    "source",
                    "origin",
                    "licence",
                    "author",
                    "repo",
                )
            },
        )
        for row in read_table(path)
    ]


def read_table(path: Path) -> list[dict[str, str]]:
    """Read a CSV table with a header as one dict a row."""
    with path.open(newline="", encoding="utf-8") as file:
        return list(csv.DictReader(file))
