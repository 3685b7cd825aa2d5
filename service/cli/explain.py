"""`meshconv3d classify --explain`: beside each record, the mesh coloured by its evidence."""

import os
from collections.abc import Iterable, Iterator, Sequence
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

import click

from service.cli.shared import STDIN

if TYPE_CHECKING:
    from model.errors import MeshError
    from service.classifier import Classification, Classifier, Source


def explain_all(
    classifier: "Classifier",
    files: Sequence[str],
    sources: "Iterable[Source]",
    out: Path,
    label: str | None,
) -> "Iterator[Classification | MeshError | OSError]":
    """Classify as `Classifier.classify_many` does, and write where each score comes from.

    A call that cannot be carried out is a usage error, before anything is read.
    """
    from service.evidence import NotExplained, explained_class

    config = classifier.model.card.config
    try:
        explained_class(config.classes, config.pooling, label)
    except NotExplained as error:
        raise click.UsageError(str(error)) from None
    return _write_all(classifier, sources, _targets(files, out), label)


def _write_all(
    classifier: "Classifier",
    sources: "Iterable[Source]",
    targets: Sequence[tuple[str, Path]],
    label: str | None,
) -> "Iterator[Classification | MeshError | OSError]":
    from service.classifier import each_of
    from service.evidence import FORMS, Explanation, explain

    work = partial(explain, classifier, label=label)
    for source, (name, target) in zip(sources, targets, strict=True):
        for result in each_of([source], work):
            if isinstance(result, Explanation):
                target.parent.mkdir(parents=True, exist_ok=True)
                target.write_bytes(FORMS[_extension(target)].write(name, result))
                yield result.classification
            else:
                yield result


def _targets(files: Sequence[str], out: Path) -> list[tuple[str, Path]]:
    """The name of each file and where its explanation goes: OUT, or into the folder OUT, which
    gets the folders of the files from where they part."""
    from model.loading import FORMATS as READ
    from service.evidence import FORMS

    if not out.is_dir() and _extension(out) in FORMS:
        if len(files) > 1:
            raise click.UsageError(f"--explain {out} is one file for {len(files)}: name a folder")
        if out.exists() and os.path.exists(files[0]) and out.samefile(files[0]):
            raise click.UsageError(f"--explain {out} would overwrite the mesh itself")
        return [(Path(files[0]).name, out)]
    if out.is_file() or (not out.is_dir() and _extension(out) in READ):
        forms = ", ".join(f".{form}" for form in FORMS)
        raise click.UsageError(f"--explain {out} is neither a folder nor a file with {forms}")
    paths = [Path("stdin" if file == STDIN else file).absolute() for file in files]
    top = os.path.commonpath([path.parent for path in paths])
    default = next(iter(FORMS))
    return [(path.name, out / f"{path.relative_to(top)}.{default}") for path in paths]


def _extension(path: Path) -> str:
    return path.suffix[1:].lower()
