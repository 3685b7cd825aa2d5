"""Teaching from a few examples: `python -m benchmarks.few_shot MODEL DATA [DATA...]`.

DATA is laid out as CLASS/files, of classes that MODEL was not trained on. Each task draws classes
and a few examples of each, teaches MODEL (`meshconv3d teach`) and classifies all other meshes of
these classes. The table has the mean over tasks of the share that is right, each class counting the
same, and its standard error.
"""

import argparse
import math
from contextlib import suppress
from pathlib import Path

import numpy as np

from meshconv3d.export.teaching import Examples, Teacher
from meshconv3d.model.datasets import list_samples
from meshconv3d.model.errors import MeshError
from meshconv3d.model.loading import load_mesh
from meshconv3d.service.models import ModelFile

SHOTS = (1, 3, 5, 10)
WAYS = 20
TASKS = 100
LEAST_TESTED = 2  # meshes of each class that are no example


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    parser.add_argument("model", help="a shipped model's name or a model file")
    parser.add_argument("data", type=Path, nargs="+", help="folders laid out as CLASS/files")
    arguments = parser.parse_args()
    teacher = Teacher(ModelFile.read(arguments.model).content)
    for data in arguments.data:
        everything = read(teacher, data)
        print(
            f"{arguments.model} on {data.name}: {len(everything.files)} meshes, "
            f"{len(everything.classes)} classes, {TASKS} tasks"
        )
        for shots in SHOTS:
            rng = np.random.default_rng(shots)
            shares = [task(teacher, everything, shots, rng) for _ in range(TASKS)]
            found = [share for share in shares if share is not None]
            if found:
                ways = min(WAYS, len(eligible(everything, shots)))
                error = np.std(found) / math.sqrt(len(found))
                print(
                    f"  {ways} classes, {shots:2} examples each: "
                    f"{np.mean(found):6.1%} +- {error:.1%}"
                )


def read(teacher: Teacher, folder: Path) -> Examples:
    """All usable meshes of a folder, with their features."""
    used, features = [], []
    for sample in list_samples(folder):
        with suppress(MeshError):
            features.append(teacher.features(load_mesh(sample.path)))
            used.append(sample)
    return Examples.of([s.label for s in used], [str(s.path) for s in used], features)


def eligible(everything: Examples, shots: int) -> np.ndarray:
    """Classes with enough meshes to learn from and to be tested on."""
    return np.flatnonzero(everything.counts >= shots + LEAST_TESTED)


def task(
    teacher: Teacher, everything: Examples, shots: int, rng: np.random.Generator
) -> float | None:
    """Mean over classes of the share that is right in one random task; None for too few classes."""
    able = eligible(everything, shots)
    if len(able) < 2:
        return None
    chosen = rng.choice(able, min(WAYS, len(able)), replace=False)
    known, asked = [], []
    for label in chosen:
        members = rng.permutation(np.flatnonzero(everything.labels == label))
        known += members[:shots].tolist()
        asked += members[shots:].tolist()
    examples = Examples.of(
        [everything.classes[label] for label in everything.labels[known]],
        [everything.files[i] for i in known],
        list(everything.features[known]),
    )
    # Classes are in alphabetical order in both.
    chosen = np.sort(chosen)
    head, _ = teacher.fit(examples)
    given = chosen[(everything.features[asked] @ head.weight.T + head.bias).argmax(axis=1)]
    labels = everything.labels[asked]
    return float(np.mean([np.mean(given[labels == label] == label) for label in chosen]))


if __name__ == "__main__":
    main()
