"""`meshconv3d inspect`: what a model file says of itself."""

import json

import click


@click.command()
@click.argument("model", required=False)
@click.option("--json", "as_json", is_flag=True, help="The card as JSON.")
def inspect(model: str | None, as_json: bool) -> None:
    """Show the card of MODEL, a shipped model's name or a model file.

    [default: the first of MESHCONV3D_MODELS, or shrec11]
    """
    from meshconv3d.service.cli.setup import load_classifier
    from meshconv3d.service.cli.terminal import printable

    opened = load_classifier(model).model
    card = opened.to_dict()
    if as_json:
        click.echo(json.dumps(card))
        return
    if about := card.pop("about"):
        for line in about.strip().splitlines():
            click.echo(printable(line))
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
