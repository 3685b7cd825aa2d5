"""Accuracy on changed test meshes: `python -m benchmarks.robustness DATA`.

Takes the test meshes of a data set, changes each in one way of `benchmarks.corruptions`, sends it
through the model's whole pipeline, and prints the accuracy for every kind of change; beside it
that of the nearest Laplace-Beltrami spectrum among the prepared training meshes, and at the end
the mean corruption error, see `docs/figures.md`. Keeps the tables as JSON in benchmarks/results/;
that of the spectra is only read where it is there already.
"""

import argparse
import json
from collections.abc import Callable
from contextlib import suppress
from functools import cached_property
from pathlib import Path

import numpy as np
from scipy.spatial import KDTree

from benchmarks.baseline_methods.spectrum import Spectrum, log_spectrum
from benchmarks.corruptions import FILES, SHAPES
from meshconv3d.model.datasets import Sample, find_samples
from meshconv3d.model.errors import MeshError, UnusableMesh
from meshconv3d.model.loading import load_mesh
from meshconv3d.model.mesh import Mesh
from meshconv3d.model.preparation import prepare
from meshconv3d.service.classifier import Classifier

RESULTS = Path(__file__).parent / "results"
FACE_BUDGET = 500
UNCHANGED = "unchanged"

Answer = Callable[[Mesh], str]
Table = dict[str, float]


class NearestSpectrum:
    """The class of the training mesh whose spectrum is nearest."""

    def __init__(self, samples: list[Sample]) -> None:
        self.samples = samples

    def answer(self, mesh: Mesh) -> str:
        tree, labels = self._known
        _, nearest = tree.query(self._spectrum(mesh))
        return labels[nearest]

    def _spectrum(self, mesh: Mesh) -> np.ndarray:
        prepared, _ = prepare(mesh, FACE_BUDGET)
        try:
            return log_spectrum(prepared, Spectrum.count)
        except ValueError:  # slivers: the Laplacian is not finite
            raise UnusableMesh("no-spectrum", "its Laplacian is not finite") from None

    @cached_property
    def _known(self) -> tuple[KDTree, list[str]]:
        spectra, labels = [], []
        for sample in self.samples:
            try:
                spectra.append(self._spectrum(load_mesh(sample.path)))
            except MeshError:
                continue
            labels.append(sample.label)
        return KDTree(spectra), labels


def accuracies(answer: Answer, samples: list[Sample]) -> Table:
    """The share of right answers without a change and with each; a refused mesh is a wrong one."""
    files = [(load_mesh(sample.path), sample.label) for sample in samples]
    shapes = []
    for mesh, label in files:
        with suppress(UnusableMesh):
            shapes.append((prepare(mesh, FACE_BUDGET)[0], label))
    changes = [(UNCHANGED, lambda mesh, rng: mesh, files)]
    changes += [(title, change, files) for title, change in FILES.items()]
    changes += [(title, change, shapes) for title, change in SHAPES.items()]
    table = {}
    for title, change, meshes in changes:
        rng = np.random.default_rng(0)
        right = 0
        for mesh, label in meshes:
            with suppress(MeshError):
                right += answer(change(mesh, rng)) == label
        table[title] = right / len(samples)
    return table


def mean_corruption_error(table: Table, baseline: Table) -> float:
    """The mean error over all changes, as a share of the baseline's."""
    changes = [title for title in table if title != UNCHANGED]
    return sum(1 - table[title] for title in changes) / sum(
        1 - baseline[title] for title in changes
    )


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    parser.add_argument("data", type=Path, help="folder laid out as CLASS/{train,test}/*.obj")
    parser.add_argument("--split", type=Path, help="CSV with the columns class,file,split")
    parser.add_argument("--model", default="shrec11", help="shipped model or model file")
    arguments = parser.parse_args()

    classifier = Classifier.load(arguments.model)
    samples = find_samples(arguments.data, arguments.split)
    test = [sample for sample in samples if sample.split == "test"]
    known = NearestSpectrum([sample for sample in samples if sample.split == "train"])
    path = RESULTS / f"robustness_spectrum_{arguments.data.name}.json"
    if not path.exists():
        baseline = accuracies(known.answer, test)
        path.write_text(json.dumps({"meshes": len(test), "accuracy": baseline}, indent=2) + "\n")
    baseline = json.loads(path.read_text())["accuracy"]
    table = accuracies(lambda mesh: classifier.classify(mesh).label, test)
    error = mean_corruption_error(table, baseline)

    name = classifier.model.card.name
    print(f"{len(test)} test meshes of {arguments.data.name}".ljust(34), f"{name:>9}  spectrum")
    for title, share in table.items():
        print(f"  {title:32} {share:9.1%} {baseline[title]:9.1%}")
    print(f"  {'mean corruption error':32} {error:9.1%} {1:9.1%}")
    results = {
        "model": classifier.model.sha256,
        "meshes": len(test),
        "accuracy": table,
        "mean_corruption_error": round(error, 5),
    }
    (RESULTS / f"robustness_{name}.json").write_text(json.dumps(results, indent=2) + "\n")


if __name__ == "__main__":
    main()
