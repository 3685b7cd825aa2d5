"""`meshconv3d export` and `verify`: write a model file, and compare one with its checkpoint."""

from dataclasses import asdict, is_dataclass, replace
from pathlib import Path
from textwrap import shorten
from typing import TYPE_CHECKING

import click

from meshconv3d.model.checkpoints import CheckpointFile, shipped_checkpoints

if TYPE_CHECKING:
    import onnx

    from meshconv3d.model.config import NetworkConfig
    from meshconv3d.model.mesh import Mesh
    from meshconv3d.model.nn.checkpoint import Checkpoint

# The shipped model files, which have the names of their checkpoints.
SHIPPED = Path(__file__).parents[1] / "service" / "shipped"

FILE = click.Path(dir_okay=False, path_type=Path)
EXISTING_FILE = click.Path(exists=True, dir_okay=False, path_type=Path)
MESHES_HELP = "Also compare on this mesh, beside the samples."


@click.command()
@click.argument("checkpoint", type=CheckpointFile())
@click.option("-o", "--output", type=FILE, required=True, help="The .onnx file to write.")
@click.option("--name", help="The model's name. [default: that of the file]")
@click.option("--card", type=EXISTING_FILE, help="Markdown that describes the model.")
@click.option("--mesh", "meshes", type=EXISTING_FILE, multiple=True, help=MESHES_HELP)
@click.option(
    "--whole",
    is_flag=True,
    help="Take vertices and faces as inputs, for other runtimes and languages (see "
    "docs/any-runtime.md). CHECKPOINT may be a model file, too, whose name and card are kept.",
)
def export(
    checkpoint: Path,
    output: Path,
    name: str | None,
    card: Path | None,
    meshes: tuple[Path, ...],
    whole: bool,
) -> None:
    """Turn CHECKPOINT, a file or the name of a shipped model, into one self-contained ONNX file.

    A model with learned pooling becomes a whole pipeline in any case, since it finds indices
    between its layers.

    The file is compared with torch on several meshes, alone and together in a ragged batch, or, if
    it is made of a model file, with that; if they differ by more than 1e-4, it is not written and
    the exit code is 1.
    """
    if not output.parent.is_dir():
        raise click.UsageError(f"no such folder: {output.parent}")
    if output.suffix.lower() != ".onnx":
        raise click.UsageError(f"--output {output} does not end with .onnx")
    if checkpoint.suffix == ".onnx" and not whole:
        raise click.UsageError(
            f"{checkpoint} is a model file already; with --whole it becomes a whole pipeline"
        )
    from meshconv3d.export.comparison import ParityError

    about = _read_text(card) if card else None
    source = _model_of(checkpoint) if whole else checkpoint
    try:
        if whole and source.suffix == ".onnx":
            model, config = _read_model(source, name, about)

            from meshconv3d.export.whole import export_whole

            made = export_whole(model, output, _prepare(config, meshes))
        else:
            loaded = _load(source)  # first: its extra has all that is needed

            from meshconv3d.export.onnx_file import export_model

            prepared = _prepare(loaded.network.config, meshes)
            title = name or output.stem
            made = export_model(loaded, output, title, prepared, about or "", whole)
    except ParityError as error:
        raise click.ClickException(f"{output} was not written: {error}") from None
    if made.config.pooling == "learned" and not whole:
        click.echo("its pooling is learned: the file takes vertices and faces, as with --whole")
    size = output.stat().st_size
    click.echo(f"wrote {output} ({size / 1e6:.2f} MB), parity {_parity(made.parity)}")


@click.command()
@click.argument("model", type=EXISTING_FILE)
@click.option(
    "--checkpoint",
    type=CheckpointFile(),
    required=True,
    help="Its checkpoint.",
)
@click.option("--mesh", "meshes", type=EXISTING_FILE, multiple=True, help=MESHES_HELP)
def verify(model: Path, checkpoint: Path, meshes: tuple[Path, ...]) -> None:
    """Check that MODEL and its card agree with the checkpoint; exits with 1 if not."""
    loaded = _load(checkpoint)  # first: its extra has all that is needed

    import numpy as np
    import onnx

    from meshconv3d.export.comparison import OUTPUTS, TOLERANCE, ParityError
    from meshconv3d.export.metadata import ModelFileError, read_card
    from meshconv3d.export.onnx_file import embedding_space, probe
    from meshconv3d.export.parity import check_parity
    from meshconv3d.model.topology.inputs import mesh_inputs

    content = model.read_bytes()
    try:
        prepared = _prepare(loaded.network.config, meshes)
        parity = check_parity(content, loaded.network, prepared)
        properties = onnx.load_model_from_string(content).metadata_props
        card = read_card({entry.key: entry.value for entry in properties})
    except (ParityError, ModelFileError) as error:
        raise click.ClickException(f"{model}: {error}") from None
    training = dict(loaded.training)
    recorded = {name: card.parity.get(name) for name in (*OUTPUTS, "tolerance")}
    if not all(isinstance(value, float) and 0 <= value <= TOLERANCE for value in recorded.values()):
        raise click.ClickException(
            f"{model}: parity on its card is {recorded}, which is none within {TOLERANCE:g}"
        )
    expected = {
        "accuracy": training.pop("accuracy", {}),
        "training": training,
        "calibration": loaded.calibration,
        "config": loaded.network.config,
        "space": embedding_space(loaded.network),
    }
    for name, value in expected.items():
        if getattr(card, name) != value:
            raise click.ClickException(f"{model}: {_differences(name, getattr(card, name), value)}")
    sample = card.probe.sample
    if sample not in prepared:
        raise click.ClickException(f"{model}: its probe is {sample!r}, which is no sample")
    inputs = mesh_inputs(prepared[sample], loaded.network.config)
    scores = probe(loaded.network, sample, inputs).scores
    if not np.allclose(card.probe.scores, scores, rtol=TOLERANCE, atol=TOLERANCE):
        raise click.ClickException(
            f"{model}: its probe has the scores {card.probe.scores} for {sample}, the checkpoint "
            f"gives {scores}"
        )
    click.echo(f"{model} agrees with {checkpoint.name}: {_parity(parity)}")


def _load(path: Path) -> "Checkpoint":
    from meshconv3d.model.nn.checkpoint import CheckpointError, load_checkpoint

    try:
        return load_checkpoint(path)
    except CheckpointError as error:
        raise click.ClickException(str(error)) from None


def _model_of(checkpoint: Path) -> Path:
    """The model file of a shipped checkpoint, which needs no torch; any other path as it is."""
    if shipped_checkpoints().get(checkpoint.stem) != checkpoint:
        return checkpoint
    return SHIPPED / f"{checkpoint.stem}.onnx"


def _read_model(
    path: Path, name: str | None, about: str | None
) -> "tuple[onnx.ModelProto, NetworkConfig]":
    """A model file, with another name and description where they are given."""
    import onnx

    from meshconv3d.export.metadata import ModelFileError, read_card
    from meshconv3d.export.runtime import is_whole, open_session

    content = path.read_bytes()
    try:
        session = open_session(content)
        properties = session.get_modelmeta().custom_metadata_map
        card = read_card(properties)
    except ModelFileError as error:
        raise click.ClickException(f"{path}: {error}") from None
    if is_whole(session):
        raise click.ClickException(f"{path} is a whole pipeline already")
    card = replace(card, name=name or card.name, about=card.about if about is None else about)
    model = onnx.load_model_from_string(content)
    onnx.helper.set_model_props(model, properties | card.to_properties())
    return model, card.config


def _read_text(path: Path) -> str:
    try:
        return path.read_text(encoding="utf-8")
    except UnicodeDecodeError:
        raise click.UsageError(f"{path} is not UTF-8 text") from None


def _prepare(config: "NetworkConfig", extra: tuple[Path, ...]) -> "dict[str, Mesh]":
    """The samples and further meshes, prepared, by name."""
    from meshconv3d.model.errors import MeshError
    from meshconv3d.model.loading import load_mesh
    from meshconv3d.model.preparation import prepare
    from meshconv3d.model.samples import sample_paths

    meshes = {}
    for name, path in {**sample_paths(), **{str(path): path for path in extra}}.items():
        try:
            meshes[name], _ = prepare(load_mesh(path), config.face_budget)
        except MeshError as error:
            raise click.ClickException(f"{path}: {error}") from None
    return meshes


def _differences(name: str, found: object, expected: object) -> str:
    """What differs between an entry of a card and the checkpoint, in words."""
    one, other = (
        asdict(value) if is_dataclass(value) and not isinstance(value, type) else value
        for value in (found, expected)
    )
    if isinstance(one, dict) and isinstance(other, dict):
        parts = [
            _differences(f"{name}.{key}", one.get(key), other.get(key))
            for key in one | other
            if one.get(key) != other.get(key)
        ]
        return "; ".join(parts)
    shown, there = (shorten(str(value), 200, placeholder=" ...") for value in (one, other))
    return f"{name} on its card is {shown}, in the checkpoint {there}"


def _parity(figures: dict) -> str:
    return (
        f"scores {figures['scores']:.1e}, evidence {figures['evidence']:.1e} "
        f"(relative, {figures['meshes']} meshes, tolerance {figures['tolerance']:g})"
    )
