"""What tests in several rooms share: meshes of known kinds, and the real data where it is."""

import tarfile
from pathlib import Path

import numpy as np
import pytest

from model.config import NetworkConfig
from model.mesh import Mesh

SHARED_DATA = Path(__file__).parents[2] / "shared" / "data"


@pytest.fixture(scope="session")
def shrec(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Folder of SHREC11 as CLASS/{train,test}/*.obj; skips where the data is not at hand."""
    archive = SHARED_DATA / "shrec_16.tar.gz"
    if not archive.is_file():
        pytest.skip("needs the SHREC11 data, which a clone does not have")
    folder = tmp_path_factory.mktemp("shrec")
    with tarfile.open(archive) as tar:
        tar.extractall(folder, filter="data")
    return folder / "shrec_16"


@pytest.fixture
def config() -> NetworkConfig:
    """A small network over three classes, with the paper's K and targets."""
    return NetworkConfig(
        classes=("ball", "box", "ring"),
        channels=(8, 12, 16),
        descriptor_hidden=8,
        descriptor_channels=6,
    )


def torus(rings: int = 25, sides: int = 10, radius: float = 1.0, tube: float = 0.4) -> Mesh:
    """A closed torus of 2 * rings * sides faces, irregular enough to have no exact ties."""
    u, v = np.meshgrid(np.arange(rings), np.arange(sides), indexing="ij")
    noise = np.random.default_rng(7).uniform(-0.2, 0.2, (2, rings, sides))
    a, b = 2 * np.pi * (u + noise[0]) / rings, 2 * np.pi * (v + noise[1]) / sides
    ring = radius + tube * np.cos(b)
    vertices = np.stack([ring * np.cos(a), ring * np.sin(a), tube * np.sin(b)], -1).reshape(-1, 3)
    right, up = (u + 1) % rings, (v + 1) % sides
    corner = [i * sides + j for i, j in ((u, v), (right, v), (right, up), (u, up))]
    lower = np.stack([corner[0], corner[1], corner[2]], -1).reshape(-1, 3)
    upper = np.stack([corner[0], corner[2], corner[3]], -1).reshape(-1, 3)
    return Mesh(vertices, np.concatenate([lower, upper]))


def sheet(columns: int = 16, rows: int = 16) -> Mesh:
    """An open, slightly wavy sheet of 2 * columns * rows faces."""
    x, y = np.meshgrid(np.arange(columns + 1), np.arange(rows + 1), indexing="ij")
    noise = np.random.default_rng(3).uniform(-0.2, 0.2, (3, *x.shape))
    vertices = np.stack([x + noise[0], y + noise[1], np.sin(x / 3) + noise[2]], -1).reshape(-1, 3)
    index = np.arange(x.size).reshape(x.shape)
    a, b, c, d = index[:-1, :-1], index[1:, :-1], index[1:, 1:], index[:-1, 1:]
    faces = np.concatenate([np.stack([a, b, c], -1), np.stack([a, c, d], -1)])
    return Mesh(vertices, faces.reshape(-1, 3))
