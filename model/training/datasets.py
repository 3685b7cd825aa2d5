"""Labelled meshes from folders, prepared once and kept with their topology."""

import csv
import logging
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from meshconv3d.model.config import NetworkConfig
from meshconv3d.model.errors import MeshError, UnusableMesh
from meshconv3d.model.loading import find_meshes, load_mesh
from meshconv3d.model.mesh import Mesh
from meshconv3d.model.preparation import prepare
from meshconv3d.model.topology.inputs import MeshInputs, mesh_inputs
from meshconv3d.model.training.variation import vary

SPLITS = ("train", "val", "test")

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
    """List a data set that can be trained on: `list_samples`, and no class without training meshes.

    Raises DatasetError saying what was expected and what was found.
    """
    samples = list_samples(root, split_file)
    trained = {sample.label for sample in samples if sample.split == "train"}
    if len(trained) < 2:
        raise DatasetError(
            f"{len(trained)} classes with training meshes under {root}, at least 2 are needed: "
            f"expected {root}/CLASS/train/*.obj (or another mesh format), or a split file with "
            "the columns class,file,split"
        )
    if untrained := sorted(set(class_names(samples)) - trained):
        raise DatasetError(f"classes without training meshes: {', '.join(untrained)}")
    for label in trained:
        if not label.isprintable():
            raise DatasetError(f"a class is called {label!a}: rename its folder, as UTF-8 text")
    return samples


def list_samples(root: Path, split_file: Path | None = None) -> list[Sample]:
    """List a folder of labelled meshes, sorted by path; it may lack any split, and be empty.

    Without a split file the layout is root/class/split/file, as in SHREC11 and ManifoldNet, or,
    where no folder is a split, root/class/file: such meshes are all of the split "test".
    With one, it is root/class/file, and the file is a CSV table with the columns class, file and
    split; files that it does not name are left out, and a file may also lie in
    root/class/split/. Raises DatasetError saying what was expected and what was found.
    """
    if not root.is_dir():
        raise DatasetError(f"{root} is not a folder")
    samples = _from_table(root, split_file) if split_file else _from_folders(root)
    return sorted(samples, key=lambda sample: str(sample.path))


def _from_folders(root: Path) -> list[Sample]:
    divided, plain = [], []
    for path in find_meshes(root):
        match path.relative_to(root).parts:
            case (label, split, _) if split in SPLITS:
                divided.append(Sample(path, label, split))
            case (label, _):
                plain.append(Sample(path, label, "test"))
    # Beside split folders, a file in its class's folder belongs to no split.
    return divided or plain


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
    label, name, split = row["class"], row["file"], row["split"]
    if not label or not name or split not in SPLITS:
        raise DatasetError(
            f"{split_file}: expected a class, a file and one of {', '.join(SPLITS)}, got {row}"
        )
    candidates = [root / label / name, *(root / label / s / name for s in SPLITS)]
    path = next((path for path in candidates if path.is_file()), None)
    if path is None or not path.resolve().is_relative_to(root.resolve()):
        raise DatasetError(f"{split_file} names {label}/{name}, which is not under {root}")
    return Sample(path, label, split)


def class_names(samples: Iterable[Sample]) -> tuple[str, ...]:
    """The classes of a data set, sorted."""
    return tuple(sorted({sample.label for sample in samples}))


@dataclass(frozen=True, eq=False)
class LabelledMesh:
    """A prepared mesh with its class index; inputs are computed once."""

    mesh: Mesh
    inputs: MeshInputs
    label: int


@dataclass(frozen=True, eq=False)
class LoadedSamples:
    """The meshes of one split that could be used, and how many files could not.

    versions: for each usable file the mesh itself, then its varied copies.
    """

    versions: list[list[LabelledMesh]]
    refused: int

    @property
    def meshes(self) -> list[LabelledMesh]:
        """Every usable mesh as it was found."""
        return [versions[0] for versions in self.versions]

    @property
    def total(self) -> int:
        """Files of the split. Whoever measures accuracy counts a refused one as wrong."""
        return len(self.versions) + self.refused


def load_samples(
    samples: Sequence[Sample],
    config: NetworkConfig,
    progress: Callable[[Sequence[Sample]], Iterable[Sample]] = iter,
    copies: int = 0,
    seed: int = 0,
) -> LoadedSamples:
    """Read, prepare and build the topology of every sample, and of varied copies of it.

    A file that cannot be used is logged with its reason and counted as refused. The copies are
    those of `model.training.variation.vary`; they depend on the seed and the file's place in
    the list.
    """
    loaded: list[list[LabelledMesh]] = []
    for index, sample in enumerate(progress(samples)):
        try:
            mesh, _ = prepare(load_mesh(sample.path), config.face_budget)
        except (MeshError, OSError) as error:
            log.warning("%s is left out: %s", sample.path, error)
            continue
        rng = np.random.default_rng([seed, index])
        versions = [mesh, *_copies(mesh, config.face_budget, copies, rng)]
        label = config.classes.index(sample.label)
        loaded.append([_labelled(version, config, label) for version in versions])
    return LoadedSamples(loaded, len(samples) - len(loaded))


def _copies(mesh: Mesh, face_budget: int, count: int, rng: np.random.Generator) -> Iterator[Mesh]:
    """Varied copies of a prepared mesh, prepared again."""
    for _ in range(count):
        # What variation has made unusable teaches nothing; the mesh has its other copies.
        with suppress(UnusableMesh):
            yield prepare(vary(mesh, rng), face_budget)[0]


def _labelled(mesh: Mesh, config: NetworkConfig, label: int) -> LabelledMesh:
    return LabelledMesh(mesh, mesh_inputs(mesh, config), label)
