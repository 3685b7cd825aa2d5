"""Data sets: labelled mesh files in folders, and their splits into train, val and test."""

import csv
import io
import logging
from collections import Counter
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from meshconv3d.model.files import write_whole
from meshconv3d.model.loading import find_meshes

SPLITS = ("train", "val", "test")
# Names of split folders, and of splits in a table, in any case.
SPLIT_NAMES = {
    **{name: name for name in SPLITS},
    "training": "train",
    "valid": "val",
    "validation": "val",
    "testing": "test",
}
# Left-out files that a warning names.
NAMED = 10

log = logging.getLogger(__name__)


class DatasetError(ValueError):
    """A folder that is not laid out as a data set, or a split file that does not fit it."""


@dataclass(frozen=True)
class Sample:
    """One file of a data set: its path, class name and split ("train", "val" or "test")."""

    path: Path
    label: str
    split: str


def find_samples(root: Path, split_file: Path | None = None) -> list[Sample]:
    """List a data set to train on: `list_samples`, with training meshes of every class.

    In a folder without split folders, all meshes are training meshes. Raises DatasetError saying
    what was expected and what was found.
    """
    samples = list_samples(root, split_file, undivided="train")
    trained = {sample.label for sample in samples if sample.split == "train"}
    if len(trained) < 2:
        raise DatasetError(
            f"{len(trained)} classes with training meshes under {root}, at least 2 are needed: "
            f"expected {root}/CLASS/train/*.obj (or another mesh format), {root}/CLASS/*.obj, or a "
            "split file with the columns class,file,split"
        )
    if untrained := sorted(set(class_names(samples)) - trained):
        raise DatasetError(f"classes without training meshes: {', '.join(untrained)}")
    for label in trained:
        if not label.isprintable():
            raise DatasetError(f"a class is called {label!a}: rename its folder, as UTF-8 text")
    return samples


def list_samples(
    root: Path, split_file: Path | None = None, undivided: str = "test"
) -> list[Sample]:
    """List a folder of labelled meshes, sorted by path; it may lack any split, and be empty.

    Without a split file the layout is root/class/split/file, as in SHREC11 and ManifoldNet, or
    root/split/class/file; split folders may be written in any case, as `validation` or `valid`,
    and hold further folders. Where no folder is a split, the layout is root/class/file, and all
    belong to the split `undivided`. With a split file, a CSV table with the columns class, file
    and split, files lie in root/class/ or in its split folders, and those that the table does not
    name are left out.

    Mesh files in no split's folder are logged: how many and which. Raises DatasetError saying what
    was expected and what was found.
    """
    if not root.is_dir():
        raise DatasetError(f"{root} is not a folder")
    samples = _from_table(root, split_file) if split_file else _from_folders(root, undivided)
    return sorted(samples, key=lambda sample: str(sample.path))


def _from_folders(root: Path, undivided: str) -> list[Sample]:
    files = find_meshes(root)
    folders = {path: path.relative_to(root).parts[:-1] for path in files}
    layout = "CLASS/train/FILE, CLASS/val/FILE and CLASS/test/FILE"
    if all(names and names[0].lower() in SPLIT_NAMES for names in folders.values()):
        # Split folders lie above the classes.
        layout = "train/CLASS/FILE, val/CLASS/FILE and test/CLASS/FILE"
        folders = {path: (names[1], names[0]) for path, names in folders.items() if names[1:]}
    divided, plain = [], []
    for path, (label, *below) in ((path, names) for path, names in folders.items() if names):
        splits = [SPLIT_NAMES[name.lower()] for name in below if name.lower() in SPLIT_NAMES]
        if splits:
            divided.append(Sample(path, label, splits[0]))
        else:
            plain.append(Sample(path, label, undivided))
    # Beside split folders, files directly in the folder of a class are in no split.
    samples = divided or plain
    _report_left_out(root, files, samples, layout if divided else "CLASS/FILE")
    return samples


def _report_left_out(
    root: Path, files: Sequence[Path], samples: Sequence[Sample], layout: str
) -> None:
    taken = {sample.path for sample in samples}
    left_out = [str(path.relative_to(root)) for path in files if path not in taken]
    if left_out:
        more = len(left_out) - NAMED
        log.warning(
            "%d of %d mesh files of %s take no part (expected %s): %s%s",
            len(left_out),
            len(files),
            root,
            layout,
            ", ".join(left_out[:NAMED]),
            f" and {more} more" if more > 0 else "",
        )


def _from_table(root: Path, split_file: Path) -> list[Sample]:
    samples = []
    try:
        # utf-8-sig: spreadsheets write a byte-order mark.
        with split_file.open(newline="", encoding="utf-8-sig") as lines:
            table = csv.DictReader(lines)
            if not {"class", "file", "split"} <= set(table.fieldnames or ()):
                raise DatasetError(f"{split_file} lacks the columns class,file,split")
            samples = [_from_row(root, split_file, row) for row in table]
    except UnicodeDecodeError as error:
        raise DatasetError(f"{split_file} is not UTF-8 text: {error.reason}") from None
    except csv.Error as error:
        raise DatasetError(f"{split_file} is no table: {error}") from None
    paths = Counter(sample.path for sample in samples)
    twice = [str(path) for path, count in paths.items() if count > 1]
    if twice:
        raise DatasetError(f"{split_file} names files more than once: {', '.join(twice[:5])}")
    return samples


def _from_row(root: Path, split_file: Path, row: dict[str, str | None]) -> Sample:
    label, name, split = row["class"], row["file"], SPLIT_NAMES.get((row["split"] or "").lower())
    if not label or not name or not split:
        raise DatasetError(
            f"{split_file}: expected a class, a file and one of {', '.join(SPLITS)}, got {row}"
        )
    folder = root / label
    candidates = [folder / name]
    if folder.is_dir():
        inside = sorted(folder.iterdir())
        candidates += [below / name for below in inside if below.name.lower() in SPLIT_NAMES]
    path = next((path for path in candidates if path.is_file()), None)
    if path is None or not path.resolve().is_relative_to(root.resolve()):
        raise DatasetError(f"{split_file} names {label}/{name}, which is not under {root}")
    return Sample(path, label, split)


def class_names(samples: Iterable[Sample]) -> tuple[str, ...]:
    """The classes of a data set, sorted."""
    return tuple(sorted({sample.label for sample in samples}))


def random_split(samples: Sequence[Sample], train: int, val: int, seed: int) -> list[Sample]:
    """Draw `train` and `val` samples of each class at random; the others become the test split.

    The previous split is ignored. The choice depends on the seed, the class names and the file
    names alone; (train - n, n) holds out n of the training samples of (train, 0). Raises
    DatasetError for a class that leaves none to test on.
    """
    chosen = []
    for label, members in _shuffled(samples, seed):
        if len(members) <= train + val:
            raise DatasetError(
                f"class {label} has {len(members)} meshes: "
                f"{train} to train on and {val} to validate on leave none to test on"
            )
        for place, sample in enumerate(members):
            split = "train" if place < train else "val" if place < train + val else "test"
            chosen.append(replace(sample, split=split))
    return sorted(chosen, key=lambda sample: str(sample.path))


def hold_out(samples: Sequence[Sample], share: float, seed: int) -> set[Sample]:
    """A random share of each class's samples, rounded, to validate on."""
    drawn = (members for _, members in _shuffled(samples, seed))
    return {one for members in drawn for one in members[: round(share * len(members))]}


def _shuffled(samples: Sequence[Sample], seed: int) -> Iterator[tuple[str, list[Sample]]]:
    """Each class with its samples in random order."""
    rng = np.random.default_rng(seed)
    for label in class_names(samples):
        members = [sample for sample in samples if sample.label == label]
        members.sort(key=lambda sample: sample.path.name)
        yield label, [members[i] for i in rng.permutation(len(members))]


def write_split(samples: Sequence[Sample], path: Path) -> None:
    """Write a split as the CSV table that `list_samples` reads.

    Raises DatasetError where two files of a class share a name, which the table cannot tell apart.
    """
    names = [(sample.label, sample.path.name) for sample in samples]
    if len(set(names)) < len(names):
        twice = max(names, key=names.count)
        raise DatasetError(f"class {twice[0]} has two files called {twice[1]}: rename one")
    text = io.StringIO(newline="")
    table = csv.writer(text)
    table.writerow(("class", "file", "split"))
    table.writerows((sample.label, sample.path.name, sample.split) for sample in samples)
    write_whole(path, text.getvalue().encode())
