"""`meshconv3d classify --explain`: beside each record, the mesh coloured by its evidence."""

import os
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import click

if TYPE_CHECKING:
    from meshconv3d.service.batch.classifying import Classify
    from meshconv3d.service.classifier import Classifier
    from meshconv3d.service.prediction import Prediction
    from meshconv3d.service.workers import Task


def explaining(
    classifier: "Classifier", files: Sequence[str], out: Path, label: str | None
) -> "Classify":
    """What classifies the files, and writes where each score comes from.

    A call that cannot be carried out is a usage error, before anything is read.
    """
    from meshconv3d.service.evidence import FORMS, NotExplained, explain, explained_class
    from meshconv3d.service.records import readable

    config = classifier.model.card.config
    try:
        explained_class(config.classes, config.pooling, label)
    except NotExplained as error:
        raise click.UsageError(str(error)) from None
    named = map(readable, files)
    targets = dict(zip(named, _targets(files, out), strict=True))
    meshes = {Path(file).resolve() for file in files}
    for _, target in targets.values():
        if target.resolve() in meshes:
            raise click.UsageError(f"--explain {out} would overwrite a mesh of the call: {target}")

    def classify(task: "Task") -> "Prediction":
        found = explain(classifier, task.content, task.declared, label)
        name, target = targets[task.file or ""]
        _write(target, FORMS[_extension(target)].write(name, found))
        return found.prediction

    return classify


def _write(target: Path, content: bytes) -> None:
    try:
        target.parent.mkdir(parents=True, exist_ok=True)
        target.write_bytes(content)
    except OSError as error:
        # Not the mesh's fault, whose record would say so.
        raise click.ClickException(f"{target} cannot be written: {error.strerror}") from None


def _targets(files: Sequence[str], out: Path) -> list[tuple[str, Path]]:
    """The name of each file and where its explanation goes: OUT, or into the folder OUT, which
    gets the folders of the files from where they part."""
    from meshconv3d.model.loading import FORMATS as READ
    from meshconv3d.service.evidence import FORMS

    if not out.is_dir() and _extension(out) in FORMS:
        if len(files) > 1:
            raise click.UsageError(f"--explain {out} is one file for {len(files)}: name a folder")
        return [(Path(files[0]).name, out)]
    if out.is_file() or (not out.is_dir() and _extension(out) in READ):
        forms = ", ".join(f".{form}" for form in FORMS)
        raise click.UsageError(f"--explain {out} is neither a folder nor a file with {forms}")
    paths = [Path("stdin" if file == "-" else file).absolute() for file in files]
    top = os.path.commonpath([path.parent for path in paths])
    default = next(iter(FORMS))
    return [(path.name, out / f"{path.relative_to(top)}.{default}") for path in paths]


def _extension(path: Path) -> str:
    return path.suffix[1:].lower()
