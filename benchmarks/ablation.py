"""Ablation of the choices that the paper leaves open: `python -m benchmarks.ablation DATA`.

DATA is SHREC11. A row changes one thing in the network `default`, or is the network `paper`, and
trains it on 7 meshes of each class, with the command's own protocol but half its epochs; 3 more are
scored, as they are and as five varied copies of each (`model.training.variation`). All ten are the
training part of a random split into 10 and 10: the ten test meshes of each class take no part. Rows
are kept in benchmarks/results/ as they arrive; a run that was interrupted goes on, and a finished
one only prints its table. A row takes minutes: one seed for all of them, and more where rows are
close (`--seeds 1 2 --rows default "K = 16"`).
"""

import argparse
import json
import logging
import statistics
import tempfile
from dataclasses import replace
from pathlib import Path
from typing import Any

import torch

from meshconv3d.model.config import PRESETS, NetworkConfig
from meshconv3d.model.datasets import class_names, find_samples, random_split
from meshconv3d.model.topology.inputs import mesh_inputs
from meshconv3d.model.training.evaluation import accuracy
from meshconv3d.model.training.meshes import LoadedSamples, load_samples
from meshconv3d.model.training.trainer import Trainer, TrainingConfig

RESULTS = Path(__file__).parent / "results"
TRAIN, VAL, VARIED = 7, 3, 5
EPOCHS = 30

# By title, what differs from the preset `default`: first the choices of the preset `paper`.
ROWS: dict[str, dict[str, Any]] = {
    "default": {},
    "axes of the file": {"axes": "file"},
    "sums in eq. 4": {"patch_reduction": "sum"},
    "learned pooling": {"pooling": "learned"},
    "learned pooling to the letter": {"pooling": "learned", "literal_pooling": True},
    "paper": PRESETS["paper"],
    "plain norm in eq. 5": {"pooling_norm": "plain"},
    "absolute first term of eq. 1": {"absolute_offsets": True},
    "K = 1": {"patch_size": 1},
    "K = 4": {"patch_size": 4},
    "K = 7": {"patch_size": 7},
    "K = 16": {"patch_size": 16},
    "half the channels": {"channels": (32, 64, 128)},
    "half the descriptors": {"descriptor_hidden": 64, "descriptor_channels": 32},
}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    parser.add_argument("data", type=Path, help="folder laid out as CLASS/{train,test}/*.obj")
    parser.add_argument("--seeds", type=int, nargs="+", default=[0])
    parser.add_argument(
        "--rows", nargs="+", choices=list(ROWS), default=list(ROWS), help="to train; all are shown"
    )
    arguments = parser.parse_args()
    # The order of additions, and with it the last digits of the weights, follows the threads.
    torch.set_num_threads(1)
    # Copies that variation has made unusable are expected.
    logging.disable(logging.WARNING)

    path = RESULTS / f"ablation_{arguments.data.name}.json"
    done = json.loads(path.read_text()) if path.exists() else {}
    for seed in arguments.seeds:
        missing = [title for title in arguments.rows if str(seed) not in done.get(title, {})]
        if not missing:
            continue
        parts = load(arguments.data, seed)
        for title in missing:
            config = replace(parts["config"], **ROWS[title])
            done.setdefault(title, {})[str(seed)] = measure(config, parts, seed)
            path.write_text(json.dumps(done, indent=2) + "\n")
            print(f"seed {seed}: {title}: {done[title][str(seed)]}", flush=True)
    show(done)


def load(data: Path, seed: int) -> dict[str, Any]:
    """Training and held-out meshes of one random split, prepared."""
    samples = random_split(find_samples(data), TRAIN, VAL, seed)
    config = NetworkConfig(classes=class_names(samples))
    training = TrainingConfig(seed=seed, epochs=EPOCHS)
    parts = {split: [s for s in samples if s.split == split] for split in ("train", "val")}
    return {
        "config": config,
        "training": training,
        "train": load_samples(parts["train"], config, copies=training.copies, seed=seed),
        "val": load_samples(parts["val"], config, copies=VARIED, seed=seed),
    }


def measure(config: NetworkConfig, parts: dict[str, Any], seed: int) -> dict[str, float]:
    """Train one network and score it on what was held out."""
    train, val = read_as(config, parts["train"]), read_as(config, parts["val"])
    with tempfile.TemporaryDirectory() as folder:
        trainer = Trainer(config, parts["training"], train.versions, Path(folder))
        network = trainer.run(lambda record: None).network
    copies = [[copy] for versions in val.versions for copy in versions[1:]]
    return {
        "as_found": round(accuracy(network, val), 5),
        "varied": round(accuracy(network, LoadedSamples(copies, 0)), 5),
    }


def read_as(config: NetworkConfig, samples: LoadedSamples) -> LoadedSamples:
    """The same meshes as inputs of another network."""
    versions = [
        [replace(version, inputs=mesh_inputs(version.mesh, config)) for version in versions]
        for versions in samples.versions
    ]
    return replace(samples, versions=versions)


def show(done: dict[str, dict[str, dict[str, float]]]) -> None:
    """Print the table of means over the seeds of a row."""
    print(f"{'validation accuracy':32}  as found    varied  seeds")
    for title in ROWS:
        runs = done.get(title, {}).values()
        if not runs:
            continue
        found, varied = (
            statistics.mean(run[name] for run in runs) for name in ("as_found", "varied")
        )
        print(f"{title:32}  {found:8.2%}  {varied:8.2%}  {len(runs):5}")


if __name__ == "__main__":
    main()
