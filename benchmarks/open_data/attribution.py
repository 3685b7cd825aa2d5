"""The list of authors that is passed on with the weights."""

import re
from collections import defaultdict
from collections.abc import Sequence

from benchmarks.open_data.curation import TABLES, CuratedMesh, read_table

HEAD = """\
# Where the training data of `objects` and `parts` comes from

Made by `python -m benchmarks.open_data DATA OUT --attribution docs/models/ATTRIBUTION.md`.

The models `objects` and `parts` learn from {trained} meshes and are measured on {measured} others.
Each mesh has a licence that allows its use, change and redistribution: public domain, a
permissive software licence, or a Creative Commons licence that asks for attribution, which is
given below. No mesh is part of this project or of the weights.

**The meshes were modified**: vertices welded, scaled to one size, triangulated, simplified or
subdivided to one number of faces, and for training also turned, bent, cut and given noise. Their
authors do not endorse this project.

**The weights** of `objects` and `parts`, as checkpoints and as ONNX files, are under the licence
of this project ([MIT](../../LICENSE)): use, change and sell them. Pass this file on with them:
where weights count as adapted from the meshes, it is the attribution that CC BY, MIT, BSD and
Apache ask for. The model `shrec11` is not meant: it was trained on research data, for which no
licence is stated ([shrec11.md](shrec11.md)).

Links lead to where the files were taken from. Numbers are meshes: trained on (with those to
validate on) + only measured on. Titles are those of the files."""
# Meshes of one licence by source and author.
Works = dict[str, dict[str, list[CuratedMesh]]]
NAMED = ("CC BY",)  # licences that ask for the titles of the works


def attribution(curated: Sequence[CuratedMesh]) -> str:
    """The Markdown text: one section a licence, and in it one line an author of a source."""
    licences = {row["licence"]: row for row in read_table(TABLES / "licences.csv")}
    sources = {row["source"]: row for row in read_table(TABLES / "sources.csv")}
    sections: dict[tuple[str, str], Works] = {
        (row["name"], row["url"]): defaultdict(lambda: defaultdict(list))
        for row in licences.values()
    }
    for mesh in curated:
        about = licences[mesh.mesh.licence]
        works = sections[about["name"], about["url"]]
        works[mesh.mesh.source][mesh.mesh.author].append(mesh)
    trained = sum(_trained(mesh) for mesh in curated)
    lines = [HEAD.format(trained=trained, measured=len(curated) - trained)]
    for (name, url), works in sections.items():
        if works:
            lines.append(f"\n## {name}\n\n[The licence]({url}).\n")
        named = name.startswith(NAMED)
        for source, authors in sorted(works.items()):
            lines += _source(sources[source], dict(sorted(authors.items())), named)
    return "\n".join(lines) + "\n"


def _source(about: dict[str, str], authors: dict[str, list[CuratedMesh]], named: bool) -> list[str]:
    """The lines of a source: one, or one an author where titles are named."""
    repo = next(iter(authors.values()))[0].mesh.repo
    title = f"[{about['title']}]({about['url'] or f'https://github.com/{repo}'})"
    people = [_line(author, meshes, named) for author, meshes in authors.items()]
    if named and len(people) > 1:
        return [f"- {title}", *(f"  - {person}" for person in people)]
    return [f"- {title} by {', '.join(people)}"]


def _trained(curated: CuratedMesh) -> bool:
    return not curated.held_out and curated.mesh.split in ("train", "val")


def _line(author: str, meshes: list[CuratedMesh], named: bool) -> str:
    trained = sum(_trained(mesh) for mesh in meshes)
    person = "the authors of this project" if author == "generated here" else author
    text = f"{person} ({trained} + {len(meshes) - trained})"
    return f"{text}: {_titles(meshes)}" if named else text


def _titles(meshes: list[CuratedMesh]) -> str:
    """The titles of works, each once: `sh3d_sc__Bed_2.ply` is a Bed."""
    titles = {
        re.sub(r"_\d+$", "", m.mesh.file.removesuffix(".ply").split("__", 1)[1]) for m in meshes
    }
    return ", ".join(sorted((t.replace("_", " ") for t in titles), key=str.casefold))
