"""`meshconv3d page`: the page without a server, as a folder for any web host."""

import shlex
from pathlib import Path

import click

from meshconv3d.service.cli.setup import read_settings, usage_errors
from meshconv3d.service.cli.terminal import printable


@click.command()
@click.option(
    "--out",
    "folder",
    type=click.Path(path_type=Path),
    required=True,
    metavar="DIR",
    help="The folder to write: a new one, an empty one, or such a page, which is replaced.",
)
@click.option(
    "--model",
    "models",
    multiple=True,
    metavar="NAME_OR_FILE",
    help="Shipped model by name, or a model file; repeat it for more, the default first. "
    "[default: those that serve answers with]",
)
@click.option(
    "--library",
    type=click.Path(exists=True, dir_okay=False, path_type=Path),
    help="Library, made by meshconv3d embed, to search for meshes alike.",
)
def page(folder: Path, models: tuple[str, ...], library: Path | None) -> None:
    """Write the page as a folder that needs no server: browsers classify by themselves.

    Any web host can have the folder, below any path. Nothing is uploaded, and a page that was
    opened once works without a network. Each model is loaded when it is first used.
    """
    from meshconv3d.export.comparison import ParityError
    from meshconv3d.model.errors import Error
    from meshconv3d.service.models import ModelFile
    from meshconv3d.service.static_page import NotWritten, check_folder, write_page

    with usage_errors(NotWritten, option="--out"):
        check_folder(folder)
    settings = read_settings({"models": models, "library": library})
    with usage_errors(Error):
        files = [ModelFile.read(model) for model in settings.models]
        cards = [file.open().card for file in files]
        searched = None
        if settings.library is not None:
            from meshconv3d.service.library import Library

            searched = Library.read(settings.library, cards)
    names = [card.name for card in cards]
    repeated = next((name for name in names if names.count(name) > 1), None)
    if repeated is not None:
        raise click.UsageError(
            f"--model: two models have the name {printable(repeated)}; leave one out, or export or "
            "teach it again with another --name"
        )
    try:
        sizes = write_page(folder, files, searched)
    except ParityError as error:
        raise click.ClickException(f"{folder} was not written: {error}") from None
    click.echo(f"wrote {folder} ({_megabytes(sum(sizes.values()))}, {len(sizes)} files)")
    click.echo(f"a browser loads {_megabytes(sizes['onnxruntime.bin'])} with its first file, and")
    for name in names:
        click.echo(f"  {_megabytes(sizes[f'models/{name}.onnx'])} for {printable(name)}")
    click.echo(f"try it: python -m http.server --directory {shlex.quote(str(folder))}")


def _megabytes(size: int) -> str:
    return f"{size / 1e6:.1f} MB"
