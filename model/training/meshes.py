"""Labelled meshes: prepared once, with their topology and varied copies."""

import logging
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass

import numpy as np

from meshconv3d.model.config import NetworkConfig
from meshconv3d.model.datasets import Sample
from meshconv3d.model.errors import MeshError, UnusableMesh
from meshconv3d.model.loading import load_mesh
from meshconv3d.model.mesh import Mesh
from meshconv3d.model.preparation import prepare
from meshconv3d.model.topology.inputs import MeshInputs, mesh_inputs
from meshconv3d.model.training.variation import vary

log = logging.getLogger(__name__)

Progress = Callable[[Sequence[Sample]], Iterable[Sample]]


@dataclass(frozen=True, eq=False)
class LabelledMesh:
    """A prepared mesh with its class index; inputs are computed once."""

    mesh: Mesh
    inputs: MeshInputs
    label: int


@dataclass(frozen=True, eq=False)
class LoadedSamples:
    """The usable meshes of one split, and the number of refused files.

    versions: for each usable file the mesh itself, then its varied copies.
    """

    versions: list[list[LabelledMesh]]
    refused: int

    @property
    def meshes(self) -> list[LabelledMesh]:
        """Every usable mesh without its copies."""
        return [versions[0] for versions in self.versions]

    @property
    def total(self) -> int:
        """Files of the split; accuracy counts refused ones as wrong."""
        return len(self.versions) + self.refused


def load_samples(
    samples: Sequence[Sample], config: NetworkConfig, copies: int = 0, seed: int = 0
) -> LoadedSamples:
    """`vary_samples` of `read_samples`."""
    return vary_samples(samples, read_samples(samples, config), config, copies, seed)


def read_samples(
    samples: Sequence[Sample], config: NetworkConfig, progress: Progress = iter
) -> dict[Sample, Mesh]:
    """Read and prepare the usable files; the others are logged with the reason."""
    meshes = {}
    for sample in progress(samples):
        try:
            meshes[sample], _ = prepare(load_mesh(sample.path), config.face_budget)
        except (MeshError, OSError) as error:
            log.warning("%s is left out: %s", sample.path, error)
    return meshes


def vary_samples(
    samples: Sequence[Sample],
    meshes: Mapping[Sample, Mesh],
    config: NetworkConfig,
    copies: int,
    seed: int,
    progress: Progress = iter,
) -> LoadedSamples:
    """Build the inputs of every usable sample and of varied copies of it.

    meshes: from `read_samples`. The copies are those of `model.training.variation.vary`; they
    depend on the seed and the file's place in the list.
    """
    loaded: list[list[LabelledMesh]] = []
    for place, sample in enumerate(progress(samples)):
        if sample not in meshes:
            continue
        mesh, label = meshes[sample], config.classes.index(sample.label)
        rng = np.random.default_rng([seed, place])
        versions = [mesh, *_copies(mesh, config.face_budget, copies, rng)]
        loaded.append([LabelledMesh(v, mesh_inputs(v, config), label) for v in versions])
    return LoadedSamples(loaded, len(samples) - len(loaded))


def _copies(mesh: Mesh, face_budget: int, count: int, rng: np.random.Generator) -> Iterator[Mesh]:
    """Varied copies of a prepared mesh, prepared again; unusable ones are left out."""
    for _ in range(count):
        with suppress(UnusableMesh):
            yield prepare(vary(mesh, rng), face_budget)[0]
