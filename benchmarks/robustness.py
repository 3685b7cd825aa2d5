"""Accuracy on changed test meshes: `python -m benchmarks.robustness DATA`.

Takes the test meshes of a data set, changes each in one way, sends it through the shipped model's
whole pipeline, and prints the accuracy for every kind of change. The training copies of
`model.training.variation` are of similar kinds, but of training meshes alone. Keeps the table
as JSON in benchmarks/results/.
"""

import argparse
import json
from collections.abc import Callable
from pathlib import Path

import numpy as np
import trimesh

from meshconv3d.model.datasets import find_samples
from meshconv3d.model.errors import UnusableMesh
from meshconv3d.model.loading import load_mesh
from meshconv3d.model.mesh import Mesh
from meshconv3d.model.preparation import prepare
from meshconv3d.model.training import variation
from meshconv3d.model.training.augmentation import random_rotation
from meshconv3d.service.classifier import Classifier

RESULTS = Path(__file__).parent / "results"

Change = Callable[[Mesh, np.random.Generator], Mesh]


def with_stray_part(mesh: Mesh, rng: np.random.Generator) -> Mesh:
    """A small ball beside it: 3 % of the diagonal in radius."""
    ball = trimesh.creation.icosphere(subdivisions=1, radius=0.03 * variation.diagonal(mesh))
    beside = mesh.vertices[rng.integers(len(mesh.vertices))]
    place = beside + rng.normal(0, 0.1 * variation.diagonal(mesh), 3)
    return Mesh(
        np.concatenate([mesh.vertices, ball.vertices + place]),
        np.concatenate([mesh.faces, ball.faces + len(mesh.vertices)]),
    )


def inverted(mesh: Mesh) -> Mesh:
    """Every face wound the other way."""
    return Mesh(mesh.vertices, mesh.faces[:, ::-1])


def as_soup(mesh: Mesh) -> Mesh:
    """Three vertices of its own for every face, as in STL."""
    return Mesh(mesh.vertices[mesh.faces].reshape(-1, 3), np.arange(mesh.faces.size).reshape(-1, 3))


# Of the mesh as it is in its file.
CHANGES_OF_FILES: dict[str, Change] = {
    "unchanged": lambda mesh, rng: mesh,
    "rotated at random": lambda mesh, rng: mesh.moved(mesh.vertices @ random_rotation(rng).T),
    "winding inverted": lambda mesh, rng: inverted(mesh),
    "triangle soup": lambda mesh, rng: as_soup(mesh),
}
# Of the prepared mesh, which is sound; what they make of it is prepared once more.
CHANGES: dict[str, Change] = {
    "subdivided with jitter": variation.retriangulated,
    "two Loop subdivisions": lambda mesh, rng: variation.smoothed(mesh, 2),
    "250 faces": lambda mesh, rng: variation.with_faces(mesh, 250),
    "1000 faces": lambda mesh, rng: variation.with_faces(mesh, 1000),
    "20 000 faces": lambda mesh, rng: variation.with_faces(mesh, 20_000),
    "noise, 0.5 % of the diagonal": lambda mesh, rng: variation.noisy(mesh, 0.005, rng),
    "noise, 1 % of the diagonal": lambda mesh, rng: variation.noisy(mesh, 0.01, rng),
    "5 % of the faces cut out": lambda mesh, rng: variation.cut(mesh, 0.05, rng),
    "10 % of the faces cut out": lambda mesh, rng: variation.cut(mesh, 0.1, rng),
    "a small ball beside it": with_stray_part,
}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    parser.add_argument("data", type=Path, help="folder laid out as CLASS/{train,test}/*.obj")
    parser.add_argument("--split", type=Path, help="CSV with the columns class,file,split")
    parser.add_argument("--model", default="shrec11", help="shipped model or model file")
    arguments = parser.parse_args()

    classifier = Classifier.load(arguments.model)
    samples = [s for s in find_samples(arguments.data, arguments.split) if s.split == "test"]
    budget = classifier.model.card.config.face_budget
    labels = [sample.label for sample in samples]
    files = [load_mesh(sample.path) for sample in samples]
    prepared = [prepare(mesh, budget)[0] for mesh in files]
    print(f"{arguments.model} on {len(files)} test meshes of {arguments.data.name}")
    table = {}
    for meshes, changes in ((files, CHANGES_OF_FILES), (prepared, CHANGES)):
        for title, change in changes.items():
            rng = np.random.default_rng(0)
            found = [answer(classifier, change(mesh, rng)) for mesh in meshes]
            table[title] = float(np.mean(np.array(found) == labels))
            print(f"  {title:30} {table[title]:7.1%}", flush=True)
    results = {"model": classifier.model.sha256, "meshes": len(files), "accuracy": table}
    path = RESULTS / f"robustness_{classifier.model.card.name}.json"
    path.write_text(json.dumps(results, indent=2) + "\n")


def answer(classifier: Classifier, mesh: Mesh) -> str | None:
    """The likeliest class, or None where the mesh is refused, which counts as wrong."""
    try:
        return classifier.classify(mesh).label
    except UnusableMesh:
        return None


if __name__ == "__main__":
    main()
