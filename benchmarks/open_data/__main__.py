"""`python -m benchmarks.open_data`: the openly licensed data sets, curated and laid out."""

import argparse
from collections import defaultdict
from pathlib import Path

from benchmarks.open_data.attribution import attribution
from benchmarks.open_data.curation import (
    SETS,
    SPLITS,
    TABLES,
    CuratedMesh,
    Curation,
    CurationError,
    read_meshes,
)
from benchmarks.open_data.layout import lay_out


def main() -> None:
    parser = argparse.ArgumentParser(prog="python -m benchmarks.open_data", description=__doc__)
    parser.add_argument("data", type=Path, help="folder of open_objects.tar.xz, .csv and so on")
    parser.add_argument("out", type=Path, help="folder for objects, parts and their split tables")
    parser.add_argument("--attribution", type=Path, help="also write the list of authors there")
    arguments = parser.parse_args()
    try:
        curated = {name: curate(name, arguments.data) for name in SETS}
        for name, meshes in curated.items():
            archive = arguments.data / f"{SETS[name]}.tar.xz"
            written = lay_out(name, meshes, archive, arguments.out)
            print(summary(meshes))
            print(f"{name}: {'written to' if written else 'already in'} {arguments.out}\n")
    except (CurationError, OSError) as error:
        parser.error(str(error))
    if arguments.attribution:
        text = attribution([mesh for meshes in curated.values() for mesh in meshes])
        arguments.attribution.write_text(text, encoding="utf-8")


def curate(name: str, data: Path) -> list[CuratedMesh]:
    """Apply the tables of a set to the data in a folder."""
    return Curation.read(TABLES / name).apply(read_meshes(data / f"{SETS[name]}.csv"))


def summary(curated: list[CuratedMesh]) -> str:
    """A table of the classes: meshes of each split, and how many makers they have."""
    classes: dict[tuple[bool, str], list[CuratedMesh]] = defaultdict(list)
    for mesh in curated:
        classes[mesh.held_out, mesh.label].append(mesh)
    lines = [_row("class", *SPLITS, "makers")]
    for held_out, label in sorted(classes):
        if held_out and not any(line.startswith("held out") for line in lines):
            lines += [_total([c for c in curated if not c.held_out]), "held out"]
        lines.append(_row(label, *_counts(classes[held_out, label])))
    return "\n".join(lines)


def _total(curated: list[CuratedMesh]) -> str:
    labels = {c.label for c in curated}
    return _row(f"{len(labels)} classes", *_counts(curated))


def _counts(curated: list[CuratedMesh]) -> list[int]:
    splits = [sum(c.mesh.split == split for c in curated) for split in SPLITS]
    return [*splits, len({c.mesh.author for c in curated})]


def _row(label: str, *values: object) -> str:
    return f"{label:<18}" + "".join(f"{value!s:>8}" for value in values)


if __name__ == "__main__":
    main()
