"""Search for the same shape: `python -m benchmarks.alike MODEL DATA [DATA...]`.

DATA is laid out as CLASS/files; the meshes of its split test are a library. Each is changed as
people change meshes and searched for: the table has how often it is found first (recall at 1), of
all meshes and of those with 1,000 faces or more, and how often it is said to be the same shape, at
the probability that `meshconv3d duplicates` asks for.
Its last line has how many meshes of the library are grouped with another one, which may be right:
packs hold one thing in two sizes.
"""

import argparse
import logging
from collections.abc import Callable
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from meshconv3d.model.datasets import list_samples
from meshconv3d.model.errors import MeshError
from meshconv3d.model.loading import load_mesh
from meshconv3d.model.mesh import Mesh
from meshconv3d.model.preparation import prepare
from meshconv3d.model.training.augmentation import random_rotation
from meshconv3d.model.training.variation import mirrored, noisy, retriangulated, with_faces
from meshconv3d.service.classifier import Classifier

LEAST = 0.85
MANY_FACES = 1000
Change = Callable[[Mesh, np.random.Generator], Mesh]


def exported_again(mesh: Mesh, rng: np.random.Generator) -> Mesh:
    """Other numbers, order, position, size and pose, and coordinates of single precision."""
    order = rng.permutation(len(mesh.vertices))
    vertices = mesh.vertices @ random_rotation(rng).T * 3.7 + rng.normal(size=3)
    faces = np.argsort(order)[mesh.faces][rng.permutation(len(mesh.faces))]
    return Mesh(vertices[order].astype(np.float32), faces)


def decimated(mesh: Mesh, rng: np.random.Generator) -> Mesh:
    """Simplified to 30 % of its faces."""
    cleaned, _ = prepare(mesh, len(mesh.faces))
    return with_faces(cleaned, max(round(0.3 * len(cleaned.faces)), 60))


CHANGES: dict[str, Change] = {
    "exported again": exported_again,
    "triangulated anew": lambda mesh, rng: retriangulated(prepare(mesh, 500)[0], rng),
    "decimated to 30 %": decimated,
    "mirrored": lambda mesh, rng: mirrored(mesh),
    "noise, 0.5 % of the diagonal": lambda mesh, rng: noisy(prepare(mesh, 500)[0], 0.005, rng),
}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    parser.add_argument("model", help="a shipped model's name or a model file")
    parser.add_argument("data", type=Path, nargs="+", help="folders laid out as CLASS/files")
    arguments = parser.parse_args()
    logging.disable(logging.WARNING)
    classifier = Classifier.load(arguments.model)
    meshes = [mesh for data in arguments.data for mesh in read(data)]
    calibration = classifier.model.card.calibration
    assert calibration is not None
    library = np.stack(
        [embedding for mesh in meshes if (embedding := embed(classifier, mesh)) is not None]
    )
    print(f"{len(library)} meshes, model {classifier.model.card.name}")
    print(f"{'':30}  found first  of {MANY_FACES:,} faces  said to be the same")
    for name, change in CHANGES.items():
        rng = np.random.default_rng(0)
        first, large, same = [], [], []
        for row, mesh in enumerate(meshes):
            try:
                found = embed(classifier, change(mesh, rng))
            except MeshError:
                found = None
            if found is None:
                continue
            cosines = library @ found
            first.append(cosines.argmax() == row or cosines[row] >= cosines.max() - 1e-6)
            large.append(len(mesh.faces) >= MANY_FACES)
            same.append(calibration.same_shape_probability(cosines[row : row + 1])[0] >= LEAST)
        shares = np.mean(first), np.mean(first, where=large), np.mean(same)
        print(f"  {name:28}  {shares[0]:11.1%}  {shares[1]:14.1%}  {shares[2]:18.1%}")
    cosines = library @ library.T
    np.fill_diagonal(cosines, -1)
    grouped = cosines.max(axis=1) >= calibration.same_shape_cosine(LEAST)
    print(f"grouped with another mesh of the library: {grouped.mean():.1%}")


def read(folder: Path) -> list[Mesh]:
    """The test meshes of a folder that can be used."""
    meshes = []
    for sample in list_samples(folder):
        if sample.split == "test":
            try:
                mesh = load_mesh(sample.path)
                prepare(mesh, 500)
                meshes.append(mesh)
            except MeshError:
                continue
    return meshes


def embed(classifier: Classifier, mesh: Mesh) -> NDArray[np.float32] | None:
    try:
        return classifier.classify(mesh).embedding
    except MeshError:
        return None


if __name__ == "__main__":
    main()
