"""Augmentation in training: moved vertices over the same topology."""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from meshconv3d.model.config import NetworkConfig
from meshconv3d.model.preparation import into_unit_sphere
from meshconv3d.model.topology.geometry import face_geometry
from meshconv3d.model.topology.inputs import MeshInputs, terms_of
from meshconv3d.model.training.meshes import LabelledMesh

WAVES = 4
# Radians per radius of the unit sphere: a third of a wave to two and a half.
WAVE_NUMBERS = (2.0, 16.0)


@dataclass(frozen=True)
class Augmentation:
    """Random movements of the vertices, after a random rotation.

    scale: stretch each axis by a factor in 1 - scale to 1 + scale. jitter: standard deviation of
    vertex noise, in radii of the unit sphere. bend: standard deviation of the slopes of random
    waves.
    """

    scale: float = 0.15
    jitter: float = 0.002
    bend: float = 0.0

    def apply(
        self, sample: LabelledMesh, config: NetworkConfig, rng: np.random.Generator
    ) -> MeshInputs:
        """Network inputs of a moved copy: new descriptor terms over the same topology."""
        faces, surface = sample.mesh.faces, sample.inputs.surface
        # A class does not depend on the orientation of its mesh.
        vertices = sample.mesh.vertices @ random_rotation(rng).T
        if self.bend:
            vertices = vertices + _waves(vertices, self.bend, rng)
        vertices = vertices * rng.uniform(1 - self.scale, 1 + self.scale, 3)
        vertices = vertices + rng.normal(0.0, self.jitter, vertices.shape)
        vertices = into_unit_sphere(vertices, faces)
        geometry = face_geometry(vertices, faces)
        return replace(sample.inputs, terms=terms_of(vertices, faces, geometry, surface, config))


def _waves(
    vertices: NDArray[np.float64], slope: float, rng: np.random.Generator
) -> NDArray[np.float64]:
    """Displacement of each vertex, V x 3, by a sum of random waves."""
    moved = np.zeros_like(vertices)
    for _ in range(WAVES):
        number = np.exp(rng.uniform(*np.log(WAVE_NUMBERS)))
        direction = rng.normal(size=3)
        direction /= np.linalg.norm(direction)
        phase = rng.uniform(0, 2 * np.pi)
        height = rng.normal(0.0, slope / number, 3)
        moved += np.sin(number * (vertices @ direction) + phase)[:, None] * height
    return moved


def random_rotation(rng: np.random.Generator) -> np.ndarray:
    """A uniformly random rotation matrix, 3 x 3, from a random unit quaternion."""
    w, x, y, z = (q := rng.normal(size=4)) / np.linalg.norm(q)
    return np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
            [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
            [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
        ]
    )
