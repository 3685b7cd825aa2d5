"""Training copies of a mesh that move its vertices and leave its topology valid."""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from meshconv3d.model.config import NetworkConfig
from meshconv3d.model.preparation import into_unit_sphere
from meshconv3d.model.topology.inputs import MeshInputs, terms_of
from meshconv3d.model.training.meshes import LabelledMesh

WAVES = 4
# In radians over a radius of the unit sphere: from a third of a wave over it to two and a half.
WAVE_NUMBERS = (2.0, 16.0)


@dataclass(frozen=True)
class Augmentation:
    """How far copies differ from their mesh.

    scale: stretch each axis by a random factor in 1 - scale to 1 + scale, after a random rotation,
    so in any direction of the mesh. jitter: standard deviation of vertex noise, in radii of the
    unit sphere. bend: how far random waves bend it, as the standard deviation of their slopes.
    """

    scale: float = 0.15
    jitter: float = 0.002
    bend: float = 0.0

    def apply(
        self, sample: LabelledMesh, config: NetworkConfig, rng: np.random.Generator
    ) -> MeshInputs:
        """A moved copy as network inputs: new descriptor terms over the same topology."""
        faces, surface = sample.mesh.faces, sample.inputs.surface
        # A class does not depend on how its mesh was laid down.
        vertices = sample.mesh.vertices @ random_rotation(rng).T
        if self.bend:
            vertices = vertices + _waves(vertices, self.bend, rng)
        vertices = vertices * rng.uniform(1 - self.scale, 1 + self.scale, 3)
        vertices = vertices + rng.normal(0.0, self.jitter, vertices.shape)
        vertices = into_unit_sphere(vertices, faces)
        return replace(sample.inputs, terms=terms_of(vertices, faces, surface, config))


def _waves(
    vertices: NDArray[np.float64], slope: float, rng: np.random.Generator
) -> NDArray[np.float64]:
    """How far each vertex (V x 3) is moved by a sum of random waves."""
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
