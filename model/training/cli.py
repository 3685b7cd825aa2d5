"""`meshconv3d train`: trains a network on a folder of labelled meshes."""

import json
import re
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from meshconv3d.model.checkpoints import CheckpointFile
from meshconv3d.model.config import PRESETS, NetworkConfig, Setting, list_settings, preset

if TYPE_CHECKING:
    from meshconv3d.model.datasets import Sample
    from meshconv3d.model.nn.checkpoint import Checkpoint
    from meshconv3d.model.nn.network import Network
    from meshconv3d.model.training.meshes import LoadedSamples
    from meshconv3d.model.training.trainer import Trainer, TrainingConfig

CHECKPOINT_FILE = "model.safetensors"
CURVES_FILE = "curves.png"
SPLIT_FILE = "split.csv"
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


def _read_split(
    ctx: click.Context, parameter: click.Parameter, text: str | None
) -> Path | int | None:
    """A table's path, or N of random:N."""
    if text and (match := re.fullmatch(r"random:([1-9]\d*)", text)):
        return int(match[1])
    return EXISTING_FILE.convert(text, parameter, ctx) if text else None


def _described(setting: Setting) -> tuple[str, str]:
    """NAME=VALUE in the preset default, and what it is, with the presets that differ."""
    default, about = setting.presets["default"], setting.about
    others = [f"{name} {value}" for name, value in setting.presets.items() if value != default]
    return f"{setting.name}={default}", about + (f" [{', '.join(others)}]" if others else "")


def _show_settings(ctx: click.Context, parameter: click.Parameter, wanted: bool) -> None:
    """Print the network's settings, and end."""
    if not wanted:
        return
    formatter = ctx.make_formatter()
    with formatter.section("Settings of the network, as in the preset default"):
        formatter.write_dl([_described(setting) for setting in list_settings()])
    click.echo(formatter.getvalue(), nl=False)
    ctx.exit()


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
    callback=_read_split,
    metavar="FILE.csv|random:N",
    help="A table with the columns class,file,split (train, val, test); or N random meshes of each "
    f"class to train on and the others to test on, written to OUT/{SPLIT_FILE}.",
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
    help="A setting of the network, such as patch_size=16 or 'channels=[32,64,128]'.",
)
@click.option(
    "--settings",
    "shows_settings",
    is_flag=True,
    is_eager=True,
    expose_value=False,
    callback=_show_settings,
    help="List the settings of the network, with their values in each preset, and exit.",
)
@click.option(
    "--from",
    "start_file",
    type=CheckpointFile(),
    metavar="NAME|CHECKPOINT",
    help="Begin with the network of a shipped model (objects, parts, shrec11) or of another run, "
    "and the features it has learned, in place of --preset and --set.",
)
@click.option("--epochs", type=click.IntRange(1), default=60, show_default=True)
@click.option(
    "--batch-size",
    type=click.IntRange(2),
    default=16,
    show_default=True,
    help="Meshes in a batch; fewer where DATA has fewer training meshes.",
)
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
    help="How far random waves bend meshes in training, as the slope of the waves; 0.25 or so for "
    "classes that differ in outline, not in proportions.",
)
@click.option(
    "--hold-out",
    type=click.FloatRange(0, 0.5),
    default=0.125,
    show_default=True,
    help="Share of each class's training meshes to validate on where DATA has no usable split val.",
)
@click.option(
    "--learning-rate",
    type=click.FloatRange(0, 1, min_open=True),
    default=3e-3,
    show_default=True,
    help="The highest of the schedule; about a fifth of it to adapt a trained network (--from).",
)
@click.option("--seed", type=click.IntRange(0, 2**32 - 1), default=0, show_default=True)
@click.option("--device", default="cpu", show_default=True, help="cpu, cuda, cuda:1, ...")
@click.option("--threads", type=click.IntRange(1, 1024), help="CPU threads. [default: all]")
def train(
    data: Path,
    out: Path,
    split: Path | int | None,
    preset_name: str | None,
    settings: dict[str, Any],
    start_file: Path | None,
    epochs: int,
    batch_size: int,
    copies: int,
    bend: float,
    hold_out: float,
    learning_rate: float,
    seed: int,
    device: str,
    threads: int | None,
) -> None:
    """Train a network on DATA, laid out as CLASS/train/*.obj and CLASS/test/*.obj.

    Any format that can be classified can be trained on. Where no folder is called train, val or
    test, all of CLASS/*.obj are training meshes. Validation meshes are scored after every epoch and
    calibrate the result: probabilities, and the limit beyond which a mesh is unknown. Test meshes
    are scored once, after the last epoch. After an interruption, run the same command again: it
    goes on after the last finished epoch.
    """
    import torch

    from meshconv3d.model.datasets import SPLITS, class_names, write_split
    from meshconv3d.model.nn.checkpoint import load_checkpoint, save_checkpoint
    from meshconv3d.model.training.augmentation import Augmentation
    from meshconv3d.model.training.plots import draw_curves
    from meshconv3d.model.training.trainer import Trainer, TrainingConfig

    if threads:
        torch.set_num_threads(threads)
    if start_file and (preset_name or settings):
        raise click.UsageError("--from brings its network: leave --preset and --set out")
    with _usage_errors():
        samples = _find(data, split, seed)
    with _usage_errors("--from: "):
        start = load_checkpoint(start_file) if start_file else None
    with _usage_errors("--set: "):
        classes = class_names(samples)
        if start:
            config = replace(start.network.config, classes=classes)
        else:
            config = preset(preset_name or "default", classes, settings)
    training = TrainingConfig(
        seed=seed,
        epochs=epochs,
        batch_size=batch_size,
        learning_rate=learning_rate,
        copies=copies,
        augmentation=Augmentation(bend=bend),
    )
    out.mkdir(parents=True, exist_ok=True)
    if isinstance(split, int):
        with _usage_errors():
            write_split(samples, out / SPLIT_FILE)
    parts = _load(samples, config, training, hold_out)
    versions = parts["train"].versions
    trained = {version.label for version, *_ in versions}
    if missing := [name for i, name in enumerate(config.classes) if i not in trained]:
        raise click.UsageError(f"no training mesh can be used of: {', '.join(missing)}")
    if len(versions) < batch_size:
        # Four batches an epoch: one would leave the optimiser too few steps.
        training = replace(training, batch_size=max(len(versions) // 4, 1))
        _say(f"{len(versions)} training meshes: batches of {training.batch_size}")
    with _usage_errors():
        trainer = Trainer(config, training, versions, out, device, start and start.network)
        done = trainer.resume()
    if done:
        _say("already finished" if done == epochs else f"going on after epoch {done}")
    with _kept_on_failure(trainer):
        checkpoint = _evaluate(_run(trainer, parts["val"]), parts)
        name = split.name if isinstance(split, Path) else f"random:{split}" if split else "folders"
        totals = {name: parts[name].total for name in SPLITS}
        record: dict[str, Any] = {"data": {"name": data.resolve().name, "split": name, **totals}}
        if start:
            record["from"] = start.training
        checkpoint = replace(checkpoint, training=checkpoint.training | record)
        save_checkpoint(checkpoint, out / CHECKPOINT_FILE)
        draw_curves(trainer.history, out / CURVES_FILE)
    click.echo(f"wrote {out / CHECKPOINT_FILE}")


def _say(message: str) -> None:
    click.echo(message, err=True)


@contextmanager
def _usage_errors(prefix: str = "") -> Iterator[None]:
    """Turn errors of data, settings and devices into usage errors."""
    try:
        yield
    except (ValueError, RuntimeError, AssertionError) as error:  # torch asserts that it has CUDA
        raise click.UsageError(f"{prefix}{error}") from None


@contextmanager
def _kept_on_failure(trainer: "Trainer") -> Iterator[None]:
    """Print how to go on after an interruption or a failed write."""
    try:
        yield
    except (KeyboardInterrupt, OSError) as error:
        _say("run the same command again to go on after the last finished epoch")
        if isinstance(error, OSError):
            reason = error.strerror or str(error)
            raise click.ClickException(f"cannot write to {trainer.folder}: {reason}") from None
        raise


def _find(data: Path, split: Path | int | None, seed: int) -> "list[Sample]":
    """Samples of DATA under the requested split. Raises DatasetError."""
    from meshconv3d.model.datasets import find_samples, random_split

    if isinstance(split, int):
        return random_split(find_samples(data), split, 0, seed)
    samples = find_samples(data, split)
    if {sample.split for sample in samples} == {"train"}:
        _say(f"{data} has training meshes alone: nothing is tested (see --split)")
    return samples


def _load(
    samples: "list[Sample]", config: NetworkConfig, training: "TrainingConfig", share: float
) -> "dict[str, LoadedSamples]":
    """The meshes of each split, with varied copies of those to train and validate on.

    Where no mesh of the split val can be used, a share of the usable training meshes becomes it.
    """
    from rich.console import Console
    from rich.progress import track

    from meshconv3d.model.datasets import SPLITS, hold_out
    from meshconv3d.model.training.meshes import read_samples, vary_samples

    console = Console(stderr=True)
    bar = partial(track, console=console, disable=not console.is_terminal)
    meshes = read_samples(samples, config, partial(bar, description="Reading"))
    if not any(sample.split == "val" for sample in meshes):
        held = hold_out([s for s in meshes if s.split == "train"], share, training.seed)
        if held:
            _say(f"no validation meshes: {len(held)} training meshes are held out (--hold-out)")
        moved = {sample: replace(sample, split="val") for sample in held}
        meshes = {moved.get(sample, sample): mesh for sample, mesh in meshes.items()}
        samples = [moved.get(sample, sample) for sample in samples if sample.split != "val"]
    parts = {}
    for split, copies in zip(SPLITS, (training.copies, training.copies // 2, 0), strict=True):
        chosen = [sample for sample in samples if sample.split == split]
        varied = partial(bar, description=f"Preparing {split}")
        parts[split] = vary_samples(chosen, meshes, config, copies, training.seed, varied)
    _say(", ".join(f"{len(parts[name].versions)} {name}" for name in SPLITS) + " meshes")
    return parts


def _run(trainer: "Trainer", val: "LoadedSamples") -> "Checkpoint":
    """Train, with a line for each epoch, and the accuracy on validation meshes if there are any."""
    from meshconv3d.model.training.evaluation import accuracy

    def validate(network: "Network") -> dict[str, Any]:
        return {"val_accuracy": round(accuracy(network, val), 5)} if val.meshes else {}

    def show(record: dict[str, Any]) -> None:
        line = f"epoch {record['epoch']} of {trainer.training.epochs}: loss {record['loss']:.3f}, "
        line += f"accuracy {record['train_accuracy']:.1%}"
        if "val_accuracy" in record:
            line += f", validation {record['val_accuracy']:.1%}"
        _say(f"{line}, {record['seconds']:.0f} s")

    return trainer.run(show, validate)


def _evaluate(checkpoint: "Checkpoint", parts: "dict[str, LoadedSamples]") -> "Checkpoint":
    """Fit the out-of-distribution score to training meshes, calibrate on those of val, and measure
    the accuracy on test meshes, each where there are any."""
    from meshconv3d.model.training.evaluation import accuracy, calibrate_network, fit_feature_space

    network, test = checkpoint.network, parts["test"]
    fit_feature_space(network, parts["train"])
    calibration, measured = None, {}
    if parts["val"].meshes:
        calibration = calibrate_network(network, parts["val"])
    else:
        _say("no validation meshes: answers are not calibrated, nothing is unknown")
    if test.total:
        share = accuracy(network, test)
        click.echo(f"test accuracy {share:.2%} of {test.total} meshes")
        measured = {"selection": "last epoch", "test": round(share, 5), "test_meshes": test.total}
    training = checkpoint.training | {"accuracy": measured}
    return replace(checkpoint, calibration=calibration, training=training)
