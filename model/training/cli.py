"""`meshconv3d train`: a folder of labelled meshes in, a checkpoint with its curves out."""

import json
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from meshconv3d.model.config import PRESETS, NetworkConfig

if TYPE_CHECKING:
    from meshconv3d.model.nn.checkpoint import Checkpoint
    from meshconv3d.model.nn.network import Network
    from meshconv3d.model.training.datasets import LoadedSamples, Sample
    from meshconv3d.model.training.trainer import Trainer, TrainingConfig

CHECKPOINT_FILE = "model.safetensors"
CURVES_FILE = "curves.png"
EXISTING_FOLDER = click.Path(exists=True, file_okay=False, path_type=Path)
EXISTING_FILE = click.Path(exists=True, dir_okay=False, path_type=Path)


def _read_settings(
    ctx: click.Context, parameter: click.Parameter, texts: tuple[str, ...]
) -> dict[str, Any]:
    """NAME=VALUE as JSON values, or text where VALUE is no JSON."""
    settings = {}
    for text in texts:
        name, equals, value = text.partition("=")
        if not equals:
            raise click.BadParameter(f"{text!r} is not NAME=VALUE")
        try:
            settings[name] = json.loads(value)
        except ValueError:
            settings[name] = value
    return settings


@click.command()
@click.argument("data", type=EXISTING_FOLDER)
@click.option(
    "--out",
    type=click.Path(file_okay=False, path_type=Path),
    required=True,
    help="Folder for checkpoint, log and curves; an interrupted run there goes on.",
)
@click.option(
    "--split",
    "split_file",
    type=EXISTING_FILE,
    help="CSV with the columns class,file,split (train, val, test).",
)
@click.option(
    "--preset",
    "preset_name",
    type=click.Choice(list(PRESETS)),
    help="Network. [default: default]",
)
@click.option(
    "--set",
    "settings",
    multiple=True,
    metavar="NAME=VALUE",
    callback=_read_settings,
    help="A setting of the network, such as patch_size=16 or 'channels=[32,64,128]'; see "
    "model/config.py.",
)
@click.option(
    "--from",
    "start_file",
    type=EXISTING_FILE,
    metavar="CHECKPOINT",
    help="Begin with another run's network, and what it has learned of other classes; in place of "
    "--preset and --set.",
)
@click.option("--epochs", type=click.IntRange(1), default=60, show_default=True)
@click.option("--batch-size", type=click.IntRange(2), default=16, show_default=True)
@click.option(
    "--copies",
    type=click.IntRange(0),
    default=10,
    show_default=True,
    help="Varied copies of each training mesh: other triangles, noise, holes.",
)
@click.option(
    "--bend",
    type=click.FloatRange(0, 1),
    default=0.0,
    show_default=True,
    help="How far random waves bend meshes in training, as the slope of the waves; for things "
    "whose proportions tell nothing, 0.25 or so.",
)
@click.option(
    "--hold-out",
    type=click.FloatRange(0, 0.5),
    default=0.125,
    show_default=True,
    help="Where DATA has no split val: this share of each class's training meshes becomes it.",
)
@click.option("--seed", type=click.IntRange(0, 2**32 - 1), default=0, show_default=True)
@click.option("--device", default="cpu", show_default=True, help="cpu, cuda, cuda:1, ...")
@click.option("--threads", type=click.IntRange(1, 1024), help="CPU threads. [default: all]")
def train(
    data: Path,
    out: Path,
    split_file: Path | None,
    preset_name: str | None,
    settings: dict[str, Any],
    start_file: Path | None,
    epochs: int,
    batch_size: int,
    copies: int,
    bend: float,
    hold_out: float,
    seed: int,
    device: str,
    threads: int | None,
) -> None:
    """Train a network on DATA, laid out as CLASS/train/*.obj and CLASS/test/*.obj.

    Any format that can be classified can be trained on. Validation meshes are scored after every
    epoch, and calibrate the last: how sure an answer is, and what is unknown. Test meshes are
    scored once, after the last. Run the same command again to go on after an interruption.
    """
    import torch

    from meshconv3d.model.nn.checkpoint import save_checkpoint
    from meshconv3d.model.training import splits
    from meshconv3d.model.training.augmentation import Augmentation
    from meshconv3d.model.training.curves import draw_curves
    from meshconv3d.model.training.datasets import SPLITS, DatasetError, class_names, find_samples
    from meshconv3d.model.training.trainer import Trainer, TrainingConfig

    if threads:
        torch.set_num_threads(threads)
    try:
        samples = find_samples(data, split_file)
    except DatasetError as error:
        raise click.UsageError(str(error)) from None
    if not any(sample.split == "val" for sample in samples):
        samples = splits.hold_out(samples, hold_out, seed)
    start = _start(start_file, preset_name, settings) if start_file else None
    config = _config(class_names(samples), preset_name, settings, start)
    training = TrainingConfig(
        seed=seed,
        epochs=epochs,
        batch_size=batch_size,
        copies=copies,
        augmentation=Augmentation(bend=bend),
    )
    parts = {split: _load(samples, split, config, training) for split in SPLITS}
    versions = parts["train"].versions
    trained = {version.label for version, *_ in versions}
    if missing := [name for i, name in enumerate(config.classes) if i not in trained]:
        raise click.UsageError(f"no training mesh can be used of: {', '.join(missing)}")
    if len(versions) < batch_size:
        raise click.UsageError(
            f"{len(versions)} training meshes do not fill a batch: choose a --batch-size below"
        )
    try:
        trainer = Trainer(config, training, versions, out, device, start and start.network)
        done = trainer.resume()
    except (ValueError, RuntimeError, AssertionError) as error:  # torch asserts that it has CUDA
        raise click.UsageError(str(error)) from None
    if done:
        what = "already finished" if done == epochs else f"going on after epoch {done}"
        click.echo(what, err=True)
    checkpoint = _run(trainer, epochs, done, _validator(parts["val"]))
    checkpoint = _calibrate(checkpoint, parts)
    checkpoint.training["data"] = {
        "name": data.resolve().name,
        "split": split_file.name if split_file else "folders",
        **{split: part.total for split, part in parts.items()},
    }
    if start:
        checkpoint.training["from"] = start.training
    checkpoint.training["accuracy"] = _measure(checkpoint.network, parts["test"])
    save_checkpoint(checkpoint, out / CHECKPOINT_FILE)
    draw_curves(trainer.history, out / CURVES_FILE)
    click.echo(f"wrote {out / CHECKPOINT_FILE}")


def _start(file: Path, preset_name: str | None, settings: dict[str, Any]) -> "Checkpoint":
    """The checkpoint to begin with."""
    from meshconv3d.model.nn.checkpoint import CheckpointError, load_checkpoint

    if preset_name or settings:
        raise click.UsageError("--from brings its network: leave --preset and --set out")
    try:
        return load_checkpoint(file)
    except CheckpointError as error:
        raise click.UsageError(f"--from: {error}") from None


def _config(
    classes: tuple[str, ...],
    preset_name: str | None,
    settings: dict[str, Any],
    start: "Checkpoint | None",
) -> NetworkConfig:
    """The network over these classes."""
    from dataclasses import replace

    from meshconv3d.model.config import preset

    if start:
        return replace(start.network.config, classes=classes)
    try:
        return preset(preset_name or "default", classes, settings)
    except ValueError as error:
        raise click.UsageError(f"--set: {error}") from None


def _measure(network: "Network", test: "LoadedSamples") -> dict[str, Any]:
    """Accuracy on the test meshes with its protocol; says it too. Empty without test meshes."""
    from meshconv3d.model.training.evaluation import accuracy

    if not test.total:
        return {}
    share = accuracy(network, test)
    click.echo(f"test accuracy {share:.2%} of {test.total} meshes")
    return {"selection": "last epoch", "test": round(share, 5), "test_meshes": test.total}


def _calibrate(checkpoint: "Checkpoint", parts: "Mapping[str, LoadedSamples]") -> "Checkpoint":
    """Measure what is new to the network, and on the split val what its answers are worth."""
    from dataclasses import replace

    from meshconv3d.model.training.evaluation import calibrate_network, fit_novelty

    fit_novelty(checkpoint.network, parts["train"])
    if not parts["val"].total:
        click.echo("no validation meshes: answers are not calibrated, nothing is unknown", err=True)
        return checkpoint
    return replace(checkpoint, calibration=calibrate_network(checkpoint.network, parts["val"]))


def _load(
    samples: "list[Sample]", split: str, config: NetworkConfig, training: "TrainingConfig"
) -> "LoadedSamples":
    """The meshes of one split, under a progress bar; those to train on with their copies."""
    from rich.console import Console
    from rich.progress import track

    from meshconv3d.model.training.datasets import load_samples

    chosen = [sample for sample in samples if sample.split == split]
    console = Console(stderr=True)
    quiet = not chosen or not console.is_terminal
    return load_samples(
        chosen,
        config,
        lambda part: track(part, f"Preparing {split}", console=console, disable=quiet),
        copies={"train": training.copies, "val": training.copies // 2, "test": 0}[split],
        seed=training.seed,
    )


def _validator(val: "LoadedSamples") -> "Callable[[Network], dict[str, Any]]":
    """What measures validation accuracy after an epoch, if there is anything to measure on."""
    from meshconv3d.model.training.evaluation import accuracy

    if not val.total:
        return lambda network: {}
    return lambda network: {"val_accuracy": round(accuracy(network, val), 5)}


def _run(
    trainer: "Trainer",
    epochs: int,
    done: int,
    validate: "Callable[[Network], dict[str, Any]]",
) -> "Checkpoint":
    """Train under a progress bar."""
    from rich.console import Console
    from rich.progress import Progress

    with Progress(console=Console(stderr=True)) as progress:
        task = progress.add_task("Training", total=epochs, completed=done)

        def show(record: dict[str, Any]) -> None:
            shown = f"loss {record['loss']:.3f}, accuracy {record['train_accuracy']:.1%}"
            if "val_accuracy" in record:
                shown += f", validation {record['val_accuracy']:.1%}"
            progress.update(task, advance=1, description=f"Training ({shown})")

        return trainer.run(show, validate)
