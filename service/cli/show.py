"""`meshconv3d formats` and `meshconv3d inspect`: what is read, and what a model says of itself."""

import json
from dataclasses import asdict

import click


@click.command()
@click.option("--json", "as_json", is_flag=True, help="One JSON object a line.")
def formats(as_json: bool) -> None:
    """List the file formats that are read, and those that an extra would add."""
    from rich.console import Console
    from rich.markup import escape
    from rich.table import Table

    from meshconv3d.model.loading import TABLE

    if as_json:
        for known in TABLE.values():
            click.echo(json.dumps(asdict(known.row)))
        return
    table = Table("extension", "format", "of it", "media type", box=None, pad_edge=False)
    for known in TABLE.values():
        notes = known.notes
        if known.missing_extra:
            notes += f" (not installed: pip install 'meshconv3d[{known.missing_extra}]')"
        table.add_row(f".{known.extension}", known.title, escape(notes), known.media_types[0])
    Console().print(table)


@click.command()
@click.argument("model", required=False)
@click.option("--json", "as_json", is_flag=True, help="The card as JSON.")
def inspect(model: str | None, as_json: bool) -> None:
    """Show the card of MODEL, a shipped model's name or a model file.

    [default: the first of MESHCONV3D_MODELS, or objects]
    """
    from rich.console import Console
    from rich.markdown import Markdown

    from meshconv3d.service.cli.setup import load_classifier
    from meshconv3d.service.cli.terminal import printable

    card = load_classifier(model).model.to_dict()
    if as_json:
        click.echo(json.dumps(card))
        return
    if about := card.pop("about"):
        text = "\n".join(map(printable, about.strip().splitlines()))
        console = Console()
        if console.is_terminal:
            console.print(Markdown(text, hyperlinks=False))
        else:
            click.echo(text)
        click.echo()
    for name, value in card.items():
        click.echo(f"{name}:")
        for line in _lines(value):
            click.echo(f"  {printable(line)}")


def _lines(value: object) -> list[str]:
    """A value as indented lines: one for each key of a dictionary, lists on one line."""
    if not isinstance(value, dict):
        return [_text(value)]
    lines = []
    for key, inner in value.items():
        if isinstance(inner, dict):
            lines += [f"{key}:", *(f"  {line}" for line in _lines(inner))]
        else:
            lines.append(f"{key}: {_text(inner)}")
    return lines


def _text(value: object) -> str:
    return ", ".join(map(str, value)) if isinstance(value, list) else str(value)
