"""A curated data set on disk, as `meshconv3d train` and `evaluate` read it."""

import csv
import io
import shutil
import tarfile
from collections.abc import Iterable, Iterator
from pathlib import Path, PurePosixPath

from benchmarks.open_data.curation import SPLITS, CuratedMesh, CurationError

COLUMNS = ("class", "file", "split", "fine_class", "source", "origin", "author")


def lay_out(name: str, curated: list[CuratedMesh], archive: Path, out: Path) -> bool:
    """Write a set's meshes and split tables under `out`; False if all of it was there.

    NAME/CLASS/{train,val,test,authors}/FILE and NAME_held_out/CLASS/FILE, with a split table for
    each question: NAME.csv (train, val and test), NAME_authors.csv (makers of whom nothing is
    trained on, as a test), NAME_collected.csv (the test meshes that were not generated), and
    NAME_held_out.csv. What an earlier call wrote is replaced. Raises CurationError if a folder
    is in the way that was not written by this function, or if the archive lacks a mesh.
    """
    tables = {f"{name}{suffix}.csv": text for suffix, text in _tables(curated).items()}
    places = {(c.mesh.folder, c.mesh.file): out / _place(name, c) for c in curated}
    if all(_holds(out / file, text) for file, text in tables.items()) and all(
        place.is_file() for place in places.values()
    ):
        return False
    for folder in (out / name, out / f"{name}_held_out"):
        if folder.is_dir():
            if not (out / f"{name}.csv").is_file():
                raise CurationError(f"{folder} is in the way: move it or choose another folder")
            shutil.rmtree(folder)
    # Before the meshes: an interrupted call leaves folders that the next one may replace.
    out.mkdir(parents=True, exist_ok=True)
    for file, text in tables.items():
        (out / file).write_text(text, encoding="utf-8", newline="")
    if missing := _unpack(archive, places):
        some = ", ".join("/".join(key) for key in sorted(missing)[:5])
        raise CurationError(f"{archive} lacks {len(missing)} meshes, such as {some}")
    return True


def _place(name: str, curated: CuratedMesh) -> Path:
    if curated.held_out:
        return Path(f"{name}_held_out", curated.label, curated.mesh.file)
    return Path(name, curated.label, curated.mesh.split, curated.mesh.file)


def _tables(curated: list[CuratedMesh]) -> dict[str, str]:
    """The split tables by what follows the set's name; those without rows are left out."""
    trained = [c for c in curated if not c.held_out]
    ordinary = [c for c in trained if c.mesh.split in SPLITS[:3]]
    authors = [c for c in trained if c.mesh.split == "authors"]
    collected = [c for c in ordinary if c.mesh.split == "test" and c.mesh.origin == "collected"]
    tables = {
        "": _table((c, c.mesh.file, c.mesh.split) for c in ordinary),
        "_held_out": _table((c, c.mesh.file, "test") for c in curated if c.held_out),
    }
    if authors:
        tables["_authors"] = _table((c, f"authors/{c.mesh.file}", "test") for c in authors)
    if collected:
        tables["_collected"] = _table((c, c.mesh.file, "test") for c in collected)
    return tables


def _table(rows: Iterable[tuple[CuratedMesh, str, str]]) -> str:
    text = io.StringIO()
    table = csv.writer(text, lineterminator="\n")
    table.writerow(COLUMNS)
    for curated, file, split in rows:
        mesh = curated.mesh
        fine_class = mesh.fine_class or mesh.folder
        table.writerow(
            (curated.label, file, split, fine_class, mesh.source, mesh.origin, mesh.author)
        )
    return text.getvalue()


def _holds(path: Path, text: str) -> bool:
    return path.is_file() and path.read_text(encoding="utf-8") == text


def _unpack(archive: Path, places: dict[tuple[str, str], Path]) -> set[tuple[str, str]]:
    """Write the meshes NAME/FOLDER/FILE of an archive to their places; returns the missing."""
    missing = set(places)
    with tarfile.open(archive) as tar:
        for key, member in _meshes(tar):
            if key not in missing:
                continue
            place = places[key]
            place.parent.mkdir(parents=True, exist_ok=True)
            content = tar.extractfile(member)
            assert content is not None  # it is a file
            partial = place.with_suffix(".partial")
            with partial.open("wb") as file:
                shutil.copyfileobj(content, file)
            partial.replace(place)
            missing.discard(key)
    return missing


def _meshes(tar: tarfile.TarFile) -> Iterator[tuple[tuple[str, str], tarfile.TarInfo]]:
    for member in tar:
        parts = PurePosixPath(member.name).parts
        if member.isfile() and len(parts) == 3:
            yield parts[1:], member
