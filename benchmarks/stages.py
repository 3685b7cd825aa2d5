"""The stages between the bytes of a file and its scores, each as a call of its own."""

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from benchmarks.workloads import as_file
from meshconv3d.model.config import NetworkConfig
from meshconv3d.model.loading import load_mesh
from meshconv3d.model.mesh import Mesh
from meshconv3d.model.preparation import prepare
from meshconv3d.model.topology import Surface, build_topology
from meshconv3d.model.topology.descriptors import pooling_features
from meshconv3d.model.topology.geometry import face_geometry
from meshconv3d.model.topology.inputs import collate, mesh_inputs, terms_of
from meshconv3d.service.models import Model

OUTPUTS = ["scores", "novelty", "embedding", "evidence"]  # what the service asks of a graph


@dataclass(frozen=True)
class Stages:
    """The stages of one mesh under one model.

    config: the model's, with other targets where the mesh is of another size. The stages after
    `prepare` work on `prepared`: the mesh as preparation leaves it, or any other.
    """

    mesh: Mesh
    prepared: Mesh
    config: NetworkConfig
    model: Model

    def reader(self, extension: str) -> Callable[[], Mesh]:
        content = as_file(self.mesh, extension)
        return lambda: load_mesh(content, extension)

    def prepare(self) -> Mesh:
        return prepare(self.mesh, self.config.face_budget)[0]

    def topology(self) -> object:
        """Twins, patches and poolings of all levels."""
        surface = Surface.of(self.prepared)
        features = pooling_features(face_geometry(self.prepared.vertices, self.prepared.faces))
        config = self.config
        return build_topology(
            surface, features, config.patch_size, config.targets, config.topology_options
        )

    def descriptors(self) -> NDArray[np.float32]:
        vertices, faces = self.prepared.vertices, self.prepared.faces
        return terms_of(vertices, faces, face_geometry(vertices, faces), self._surface, self.config)

    def inputs(self) -> dict[str, NDArray]:
        """Topology and descriptors as the graph takes them."""
        return collate([mesh_inputs(self.prepared, self.config)])

    def graph(self) -> list[Any]:
        return list(self.model.session.run(OUTPUTS, self.arrays))

    def scores(self) -> list[Any]:
        """From the arrays of a prepared mesh to scores."""
        return list(self.model.session.run(OUTPUTS, self.inputs()))

    @cached_property
    def arrays(self) -> dict[str, NDArray]:
        return self.inputs()

    @cached_property
    def _surface(self) -> Surface:
        return Surface.of(self.prepared)
