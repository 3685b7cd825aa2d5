"""`meshconv3d explain`: one mesh in, the same out, coloured by what each face says for a class."""

import os
import sys
from dataclasses import replace
from pathlib import Path

import click

from meshconv3d.service.cli.setup import (
    format_option,
    list_files,
    load_classifier,
    model_option,
    read_settings,
    usage_errors,
)


@click.command()
@click.argument("file")
@click.option(
    "-o",
    "--output",
    "out",
    type=click.Path(dir_okay=False, path_type=Path),
    required=True,
    metavar="OUT",
    help="Write the mesh in colours to OUT.glb or .ply, or its numbers to OUT.json.",
)
@click.option("--class", "label", metavar="NAME", help="Explain this class, not the likeliest.")
@model_option
@format_option
@click.pass_context
def explain(
    ctx: click.Context,
    file: str,
    out: Path,
    label: str | None,
    model: str | None,
    declared: str | None,
) -> None:
    """Colour the mesh in FILE by what each of its faces adds to the score of a class.

    Orange speaks for the class, blue against it. FILE is a mesh file, a URL, or - for standard
    input. Prints the record of `meshconv3d classify`, too. Exits with 0 if the mesh was explained,
    1 if it cannot be used, 2 if the call itself is wrong.
    """
    from meshconv3d.model.files import replacing
    from meshconv3d.service.attribution import FORMS, NotExplained, explained_class
    from meshconv3d.service.batch.running import Options, SerialExecutor
    from meshconv3d.service.cli.terminal import Printer, TablePrinter
    from meshconv3d.service.prediction import Prediction
    from meshconv3d.service.workers import ExplanationOptions, Task, predict

    form = out.suffix[1:].lower()
    if form not in FORMS:
        forms = ", ".join(f".{name}" for name in FORMS)
        raise click.UsageError(f"--output {out} does not end with a form that is written: {forms}")
    if os.path.exists(out) and os.path.exists(file) and os.path.samefile(file, out):
        raise click.UsageError(f"--output {out} is the mesh itself: name another file")
    (place,) = list_files([file], declared=declared).places
    if place.root is not None:
        raise click.UsageError(f"{file} is no file: explain takes one mesh")
    classifier = load_classifier(model)
    config = classifier.model.card.config
    with usage_errors(NotExplained):
        explained_class(config.classes, config.pooling, label)
    asked = ExplanationOptions(form, label)

    def explained(task: Task) -> Prediction:
        named = replace(task, file=os.path.basename(task.file or "-"), explanation=asked)
        return predict(named, classifier, False)

    options = Options(classifier.model.id.name, read_settings({}).worker_memory_bytes)
    (one,) = SerialExecutor(explained, options).results(place.find(), lambda _: ())
    if isinstance(one.result, Prediction):
        assert one.result.explanation is not None
        out.parent.mkdir(parents=True, exist_ok=True)
        with replacing(out) as written:
            written.write(one.result.explanation)
    printer = TablePrinter(None) if sys.stdout.isatty() else Printer(None)
    with printer:
        printer.add(one.file.name, one.result)
    ctx.exit(0 if one.fault is None else 1)
