"""Shipped models of the open data: `python -m benchmarks.open_data.heads CHECKPOINT DATA OUT`.

CHECKPOINT is a network that was trained on the classes of both sets at once, objects and parts;
DATA is what `python -m benchmarks.open_data` laid out. A model is that network with the rows of its
classifier that score one set's classes, so that both models have one embedding. Out-of-distribution
score and calibration are measured on the set's own meshes, on shapes of no class, and on the other
set's validation meshes, which are of no class either. Writes OUT/objects.safetensors and
OUT/parts.safetensors, and prints their accuracy on meshes to test on, which chose nothing; how well
they tell test meshes from those of classes that were left out, and from shapes made anew, is the
area under the curve.
"""

import argparse
import logging
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import replace
from pathlib import Path

import numpy as np
import torch

from benchmarks.alike import CHANGES
from benchmarks.open_data.curation import SETS
from benchmarks.shapes import make_shapes
from benchmarks.unknown import area_under_curve
from meshconv3d.model.calibration import fit_same_shape
from meshconv3d.model.datasets import Sample, class_names, list_samples
from meshconv3d.model.errors import MeshError
from meshconv3d.model.loading import load_mesh
from meshconv3d.model.mesh import Mesh
from meshconv3d.model.metrics import is_among_top
from meshconv3d.model.nn.checkpoint import Checkpoint, load_checkpoint, save_checkpoint
from meshconv3d.model.nn.network import Network
from meshconv3d.model.preparation import prepare
from meshconv3d.model.topology.inputs import mesh_inputs
from meshconv3d.model.training.evaluation import (
    calibrate_network,
    labels_of,
    pooled_features,
    predict,
)
from meshconv3d.model.training.meshes import LabelledMesh, LoadedSamples, load_samples

# Varied copies of each mesh.
COPIES = {"train": 3, "val": 5}
# How copies of training meshes are changed, from which the axes of the embedding are measured.
CHANGED = ("triangulated anew", "decimated to 30 %", "noise, 0.5 % of the diagonal")
# Shapes of no class, of each kind, and their seeds.
SHAPES = {"train": (8, 2), "val": (5, 3), "test": (5, 1)}
# Tables of DATA beside that of a set: further meshes of its classes to test on.
TESTED = {"objects": ("authors",), "parts": ("collected",)}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    parser.add_argument("checkpoint", type=Path)
    parser.add_argument("data", type=Path)
    parser.add_argument("out", type=Path)
    arguments = parser.parse_args()
    logging.disable(logging.WARNING)  # unusable copies are expected
    torch.set_num_threads(1)
    trained = load_checkpoint(arguments.checkpoint)
    samples = {
        name: list_samples(arguments.data / name, table(arguments.data, name)) for name in SETS
    }
    networks = {name: head(trained.network, class_names(s)) for name, s in samples.items()}
    training = {
        name: load_samples(
            [s for s in samples[name] if s.split == "train"], network.config, COPIES["train"]
        )
        for name, network in networks.items()
    }
    # The features are those of the one network, whatever its head.
    pooled = {name: pooled_features(trained.network, s) for name, s in training.items()}
    both = {
        split: [s for name in SETS for s in samples[name] if s.split == split]
        for split in ("train", "val")
    }
    trained.network.embedding.fit(*changed(both["train"], trained.network, CHANGED))
    features, meshes = changed(both["val"], trained.network, tuple(CHANGES))
    same_shape = fit_same_shape(trained.network.embedding(features).numpy(), meshes.numpy())
    shapes = {split: shapes_of_no_class(trained.network, *SHAPES[split]) for split in SHAPES}
    others = pooled_features(trained.network, alone(shapes["train"]))
    vals = {name: [s for s in samples[name] if s.split == "val"] for name in SETS}
    for name, network in networks.items():
        network.embedding.load_state_dict(trained.network.embedding.state_dict())
        network.novelty.fit(pooled[name], labels_of(training[name]), others)
        val = vals[name]
        [other] = SETS.keys() - {name}
        strangers = load_samples(vals[other], networks[other].config).meshes
        calibration = calibrate_network(
            network,
            load_samples(val, network.config, COPIES["val"]),
            [*strangers, *shapes["val"]],
        )
        calibration = replace(calibration, same_shape=same_shape)
        counts = {
            split: sum(s.split == split for s in samples[name])
            for split in ("train", "val", "test")
        }
        accuracy: dict[str, float | int | str] = {"selection": "last epoch"}
        parts = {"val": val, "test": [s for s in samples[name] if s.split == "test"]}
        for more in TESTED[name]:
            parts[more] = list_samples(
                arguments.data / name, table(arguments.data, f"{name}_{more}")
            )
        for part, chosen in parts.items():
            accuracy |= measured(part, network, chosen)
        held_out = usable(sorted((arguments.data / f"{name}_held_out").glob("*/*")), network)
        known = load_samples(parts["test"], network.config).meshes
        for kind, meshes in (("classes", held_out), ("shapes", shapes["test"])):
            novelty = [predict(network, each).novelty.numpy() for each in (known, meshes)]
            accuracy[f"unknown_{kind}_auroc"] = round(area_under_curve(*novelty), 5)
        record = trained.training | {
            "data": {"name": SETS[name], "split": f"{name}.csv", **counts},
            "accuracy": accuracy,
        }
        print(name, accuracy, flush=True)
        path = arguments.out / f"{name}.safetensors"
        save_checkpoint(Checkpoint(network, calibration, record), path)


def changed(
    samples: Sequence[Sample], network: Network, changes: Sequence[str]
) -> tuple[torch.Tensor, torch.Tensor]:
    """Features of meshes and of copies that are changed as people change meshes, M x C, and the
    number of the mesh of each, M."""
    features, numbers = [], []
    for number, sample in enumerate(samples):
        rng = np.random.default_rng(number)
        with suppress(MeshError):
            mesh = load_mesh(sample.path)
            versions = [prepared(mesh, network)]
            for change in changes:
                with suppress(MeshError):
                    versions.append(prepared(CHANGES[change](mesh, rng), network))
            features.append(pooled_features(network, alone(versions)))
            numbers += [len(features) - 1] * len(versions)
    return torch.cat(features), torch.tensor(numbers)


def shapes_of_no_class(network: Network, of_each: int, seed: int) -> list[LabelledMesh]:
    """Shapes of every kind, prepared; their label has no meaning."""
    return [prepared(shape, network) for shape in make_shapes(of_each, seed)]


def usable(paths: Sequence[Path], network: Network) -> list[LabelledMesh]:
    """The meshes of files, prepared, without those that are refused; labels have no meaning."""
    found = []
    for path in paths:
        with suppress(MeshError):
            found.append(prepared(load_mesh(path), network))
    return found


def prepared(mesh: Mesh, network: Network) -> LabelledMesh:
    ready, _ = prepare(mesh, network.config.face_budget)
    return LabelledMesh(ready, mesh_inputs(ready, network.config), 0)


def alone(meshes: Sequence[LabelledMesh]) -> LoadedSamples:
    """Meshes without varied copies."""
    return LoadedSamples([[mesh] for mesh in meshes], 0)


def table(data: Path, name: str) -> Path:
    return data / f"{name}.csv"


def head(network: Network, classes: tuple[str, ...]) -> Network:
    """The network with the scores of some of its classes alone."""
    made = Network(replace(network.config, classes=classes))
    made.take_features(network)
    rows = [network.config.classes.index(label) for label in classes]
    with torch.no_grad():
        made.classify.weight.copy_(network.classify.weight[rows])
        made.classify.bias.copy_(network.classify.bias[rows])
    return made.eval()


def measured(part: str, network: Network, samples: list[Sample]) -> dict[str, float | int]:
    """Top-1, top-5 and balanced accuracy of a part; refused files count as wrong."""
    loaded = load_samples(samples, network.config)
    labels = np.array([mesh.label for mesh in loaded.meshes])
    scores = predict(network, loaded.meshes).scores.numpy()
    right = is_among_top(labels, scores, 1)
    share = {
        part: float(right.sum()) / loaded.total,
        f"{part}_top5": float(is_among_top(labels, scores, 5).sum()) / loaded.total,
        f"{part}_balanced": float(np.mean([right[labels == c].mean() for c in np.unique(labels)])),
    }
    return {
        **{name: round(value, 5) for name, value in share.items()},
        f"{part}_meshes": loaded.total,
    }


if __name__ == "__main__":
    main()
