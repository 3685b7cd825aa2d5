"""Random splits of a labelled folder, the same for everyone who names the same seed."""

import csv
from collections import defaultdict
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from meshconv3d.model.training.datasets import DatasetError, Sample


def random_split(samples: Sequence[Sample], train: int, val: int, seed: int) -> list[Sample]:
    """Of every class, `train` random samples to train on, `val` to validate on, the rest to test.

    Whatever split the samples had is forgotten. Which samples they are depends on the seed, the
    class names and the files' names alone; (train - n, n) holds n of the training samples of
    (train, 0) out. Raises DatasetError for a class that leaves nothing to test on.
    """
    by_class: dict[str, list[Sample]] = defaultdict(list)
    for sample in samples:
        by_class[sample.label].append(sample)
    rng = np.random.default_rng(seed)
    chosen = []
    for label, members in sorted(by_class.items()):
        if len(members) <= train + val:
            raise DatasetError(
                f"class {label} has {len(members)} meshes: "
                f"{train} to train on and {val} to validate on leave none to test on"
            )
        members = sorted(members, key=lambda sample: sample.path.name)
        for place, i in enumerate(rng.permutation(len(members))):
            split = "train" if place < train else "val" if place < train + val else "test"
            chosen.append(replace(members[i], split=split))
    return sorted(chosen, key=lambda sample: str(sample.path))


def hold_out(samples: Sequence[Sample], share: float, seed: int) -> list[Sample]:
    """Move a random share of each class's training samples to the split val, rounded."""
    rng = np.random.default_rng(seed)
    held = set()
    for label in sorted({sample.label for sample in samples}):
        mine = [s for s in samples if s.label == label and s.split == "train"]
        mine.sort(key=lambda sample: sample.path.name)
        chosen = rng.permutation(len(mine))[: round(share * len(mine))]
        held |= {mine[i] for i in chosen}
    return [replace(s, split="val") if s in held else s for s in samples]


def write_split(samples: Sequence[Sample], path: Path) -> None:
    """Write a split as the CSV table that `find_samples` reads.

    Raises DatasetError where two files of a class share a name, which the table cannot tell apart.
    """
    names = [(sample.label, sample.path.name) for sample in samples]
    if len(set(names)) < len(names):
        twice = max(names, key=names.count)
        raise DatasetError(f"class {twice[0]} has two files called {twice[1]}: rename one")
    with path.open("w", newline="", encoding="utf-8") as file:
        table = csv.writer(file)
        table.writerow(("class", "file", "split"))
        table.writerows((sample.label, sample.path.name, sample.split) for sample in samples)
