"""Comparison of out-of-distribution scores: `python -m benchmarks.unknown DATA`.

DATA is SHREC11. Each fold leaves a fifth of the classes out, trains on the others with the
command's own protocol, and then asks for meshes of all classes, as they are and as two varied
copies of each, and for shapes of no class at all (`benchmarks.shapes`). For every score the table
has how well it parts known test meshes from each of these (area under the ROC curve), and, with
the limit at which 2 % of the validation meshes are refused, how many known test meshes and how
many others are. Folds are kept in benchmarks/results/ as they arrive.
"""

import argparse
import json
import logging
import statistics
import tempfile
from pathlib import Path

import numpy as np
import torch
from numpy.typing import NDArray

from benchmarks.shapes import make_shapes
from meshconv3d.model.calibration import KNOWN_REFUSED, softmax
from meshconv3d.model.config import NetworkConfig
from meshconv3d.model.datasets import Sample, find_samples, hold_out
from meshconv3d.model.nn.network import Network, as_tensors
from meshconv3d.model.preparation import prepare
from meshconv3d.model.topology.inputs import collate, mesh_inputs
from meshconv3d.model.training.evaluation import fit_feature_space, predict
from meshconv3d.model.training.meshes import LabelledMesh, LoadedSamples, load_samples
from meshconv3d.model.training.trainer import Trainer, TrainingConfig

RESULTS = Path(__file__).parent / "results"
FOLDS = 5
COPIES = 2
SHAPES_OF_EACH_KIND = 8
OTHERS = ("unknown classes", "shapes of no class")

Scores = dict[str, NDArray[np.float64]]


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    parser.add_argument("data", type=Path, help="folder laid out as CLASS/{train,test}/*.obj")
    parser.add_argument("--folds", type=int, nargs="+", default=list(range(FOLDS)))
    arguments = parser.parse_args()
    torch.set_num_threads(1)
    logging.disable(logging.WARNING)  # copies that variation has made unusable are expected

    path = RESULTS / f"unknown_{arguments.data.name}.json"
    done = json.loads(path.read_text()) if path.exists() else {}
    for fold in arguments.folds:
        if str(fold) not in done:
            done[str(fold)] = measure(find_samples(arguments.data), fold)
            path.write_text(json.dumps(done, indent=2) + "\n")
            print(f"fold {fold} done", flush=True)
    show([done[str(fold)] for fold in arguments.folds])


def measure(samples: list[Sample], fold: int) -> dict[str, dict[str, float]]:
    """Train without a fifth of the classes; returns the figures of every score."""
    names = np.random.default_rng(0).permutation(sorted({s.label for s in samples}))
    left_out = set(np.array_split(names, FOLDS)[fold])
    known = [s for s in samples if s.label not in left_out]
    held = hold_out([s for s in known if s.split == "train"], 0.125, seed=0)
    config = NetworkConfig(classes=tuple(sorted(set(names) - left_out)))
    training = TrainingConfig()

    def load(split: str, copies: int) -> LoadedSamples:
        chosen = [s for s in known if ("val" if s in held else s.split) == split]
        return load_samples(chosen, config, copies=copies)

    train = load("train", training.copies)
    with tempfile.TemporaryDirectory() as folder:
        trainer = Trainer(config, training, train.versions, Path(folder))
        network = trainer.run(lambda record: None).network
    fit_feature_space(network, train)
    everyone = NetworkConfig(classes=tuple(sorted(names)))
    others = [s for s in samples if s.label in left_out]
    shapes = (prepare(mesh, config.face_budget)[0] for mesh in make_shapes(SHAPES_OF_EACH_KIND, 0))
    meshes = {
        "val": versions(load("val", training.copies // 2)),
        "test": versions(load("test", COPIES)),
        "unknown classes": versions(load_samples(others, everyone, copies=COPIES)),
        "shapes of no class": [LabelledMesh(m, mesh_inputs(m, config), 0) for m in shapes],
    }
    scores = {part: score(network, of_part) for part, of_part in meshes.items()}
    return {name: figures({p: s[name] for p, s in scores.items()}) for name in scores["val"]}


def versions(samples: LoadedSamples) -> list[LabelledMesh]:
    return [version for of_one in samples.versions for version in of_one]


def score(network: Network, meshes: list[LabelledMesh]) -> Scores:
    """Every score for every mesh; higher is more unknown."""
    outputs = predict(network, meshes)
    novelty = network.novelty
    logits = outputs.scores.numpy().astype(np.float64)
    with torch.inference_mode():
        inputs = [as_tensors(collate([mesh.inputs])) for mesh in meshes]
        pooled = torch.cat([network.features(*tensors)[1] for tensors in inputs])
        # What novelty takes off the distance to the nearest class is put back.
        overall = ((pooled - novelty.centre) @ novelty.overall).square().sum(dim=1)
    return {
        "probability": -softmax(logits).max(axis=1),
        "largest logit": -logits.max(axis=1),
        "energy": -np.log(np.exp(logits).sum(axis=1)),
        "Mahalanobis distance": (outputs.novelty + overall).numpy(),
        "the same, relative": outputs.novelty.numpy(),
    }


def figures(scores: Scores) -> dict[str, float]:
    """Figures of one score, by part of the data."""
    limit = np.quantile(scores["val"], 1 - KNOWN_REFUSED)
    table = {"known refused": float(np.mean(scores["test"] > limit))}
    for part in OTHERS:
        table[f"{part}, area"] = area_under_curve(scores["test"], scores[part])
        table[f"{part}, refused"] = float(np.mean(scores[part] > limit))
    return {name: round(value, 5) for name, value in table.items()}


def area_under_curve(known: NDArray, unknown: NDArray) -> float:
    """How often an unknown mesh scores above a known one; half where they are equal."""
    above = (unknown[:, None] > known).mean() + (unknown[:, None] == known).mean() / 2
    return float(above)


def show(folds: list[dict[str, dict[str, float]]]) -> None:
    """Print the table: means over the folds."""
    print(f"mean of {len(folds)} folds; refused at the limit that refuses 2 % of validation meshes")
    print(f"{'':22}     known   unknown classes   shapes of no class")
    print(f"{'score':22}   refused    area  refused       area  refused")
    for name in folds[0]:
        known, area, refused, shape_area, shape_refused = (
            statistics.mean(fold[name][column] for fold in folds) for column in folds[0][name]
        )
        print(
            f"{name:22}  {known:8.1%}  {area:6.3f}  {refused:7.1%}     "
            f"{shape_area:6.3f}  {shape_refused:7.1%}"
        )


if __name__ == "__main__":
    main()
