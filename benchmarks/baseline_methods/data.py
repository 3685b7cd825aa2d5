"""The files of a split, prepared once for all baselines."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from meshconv3d.model.datasets import Sample
from meshconv3d.model.errors import MeshError
from meshconv3d.model.loading import load_mesh
from meshconv3d.model.mesh import Mesh
from meshconv3d.model.preparation import prepare

FACE_BUDGET = 500  # as for the network


@dataclass(frozen=True, eq=False)
class Part:
    """The prepared meshes of a split.

    labels: N int64, the class of each mesh. refused: int64, the classes of the files that could
    not be used. classes: N_c, of the whole data set.
    """

    meshes: list[Mesh]
    labels: NDArray[np.int64]
    refused: NDArray[np.int64]
    classes: int


def read_part(samples: Sequence[Sample], classes: Sequence[str]) -> Part:
    """Read and prepare the files like those of the network."""
    meshes, labels, refused = [], [], []
    for sample in samples:
        label = classes.index(sample.label)
        try:
            mesh, _ = prepare(load_mesh(sample.path), FACE_BUDGET)
        except MeshError:
            refused.append(label)
            continue
        meshes.append(mesh)
        labels.append(label)
    return Part(meshes, np.array(labels, int), np.array(refused, int), len(classes))
