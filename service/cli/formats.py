"""`meshconv3d formats`: what this installation reads."""

import json

import click


@click.command()
@click.option("--json", "as_json", is_flag=True, help="One JSON object a line.")
def formats(as_json: bool) -> None:
    """List the file formats that are read."""
    from rich.console import Console
    from rich.table import Table

    from meshconv3d.model.loading import FORMATS

    if as_json:
        for known in FORMATS.values():
            click.echo(json.dumps(known.to_dict()))
        return
    table = Table("extension", "format", "of it", "media type", box=None, pad_edge=False)
    for known in FORMATS.values():
        table.add_row(f".{known.extension}", known.title, known.notes, known.media_types[0])
    Console().print(table)
