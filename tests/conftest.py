"""What tests in several rooms share: a small network and its files, and the real data."""

import fcntl
import os
import shutil
import subprocess
import sys
import tarfile
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import pytest
from hypothesis import settings

from meshconv3d.model.config import PRESETS, NetworkConfig

# Torch reads this when it is first imported. The matrices of tests are so small that handing
# them to several threads costs more than multiplying them.
os.environ.setdefault("OMP_NUM_THREADS", "1")

# The programs that tests start would compile the project's modules anew, each at its start.
os.environ.pop("PYTHONDONTWRITEBYTECODE", None)

# The first call of a kernel compiles it.
settings.register_profile("kernels", deadline=None)
settings.load_profile("kernels")
# To fuzz for minutes: pytest --hypothesis-profile=long tests/model/loading/test_fuzzing.py
settings.register_profile("long", deadline=None, max_examples=20_000)

# Both halves of the kernels: the first call of each compiles it.
KERNELS = (
    "from meshconv3d.model.preparation import prepare\n"
    "from tests.meshes import cube, icosphere\n"
    "prepare(icosphere(4), 500), prepare(cube(), 500)",
    "from meshconv3d.model import loading\n"
    "from meshconv3d.model.topology.inputs import mesh_inputs\n"
    "from tests.conftest import WIDER\n"
    "from tests.meshes import icosphere\n"
    "mesh_inputs(icosphere(), WIDER), loading.warm_up()",
)


def pytest_sessionstart(session: pytest.Session) -> None:
    """Compile the kernels in two processes before a run of all tests: else every process, and every
    service that a test starts meanwhile, would compile them for itself."""
    config = session.config
    if hasattr(config, "workerinput") or config.args != config.getini("testpaths"):
        return
    started = [subprocess.Popen([sys.executable, "-c", code], cwd=ROOT) for code in KERNELS]
    for process in started:
        process.wait()


SMALL = NetworkConfig(
    classes=("ball", "box", "ring"),
    channels=(8, 12, 16),
    descriptor_hidden=8,
    descriptor_channels=6,
)
# What the preset `objects` adds.
WIDER = replace(SMALL, **PRESETS["objects"])
ROOT = Path(__file__).parents[1]
SHARED_DATA = ROOT.parent / "shared" / "data"


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


@pytest.fixture(scope="session")
def objects69(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Folder of everyday objects as CLASS/*.ply, its split beside it as `split.csv`; skips where
    the data is not at hand."""
    archive = SHARED_DATA / "objects69.tar.xz"
    if not archive.is_file():
        pytest.skip("needs the data of everyday objects, which a clone does not have")
    folder = tmp_path_factory.mktemp("objects")
    with tarfile.open(archive) as tar:
        tar.extractall(folder, filter="data")
    shutil.copy(SHARED_DATA / "objects69_split.csv", folder / "split.csv")
    return folder / "objects69"


@pytest.fixture
def config() -> NetworkConfig:
    """A small network over three classes, with the paper's K and targets."""
    return SMALL


@pytest.fixture(params=[SMALL, WIDER], ids=["default", "objects"])
def either(request: pytest.FixtureRequest) -> NetworkConfig:
    """That network, and one that reads all that can be read of a face."""
    return request.param


def tiny_checkpoint(config: NetworkConfig, path: Path) -> Path:
    """Save a checkpoint of a small, untrained network."""
    from meshconv3d.model.calibration import Calibration
    from meshconv3d.model.nn.checkpoint import Checkpoint, save_checkpoint
    from tests.networks import untrained

    training = {"data": {"name": "none"}, "accuracy": {"test": 0.25}}
    calibration = Calibration(
        2.0, novelty_limit=1e6, novelty_scale=1.0, meshes=9, same_shape=(-4.0, -8.0)
    )
    save_checkpoint(Checkpoint(untrained(config), calibration, training), path)
    return path


def exported(source: Path, path: Path, *options: str) -> Path:
    """The file that `meshconv3d export` makes of a checkpoint, or of a model file."""
    from click.testing import CliRunner

    from meshconv3d.service.cli.main import commands

    result = CliRunner().invoke(commands, ["export", str(source), "-o", str(path), *options])
    assert result.exit_code == 0, result.output
    return path


def made_once(name: str, make: Callable[[Path], Path], temporary: pytest.TempPathFactory) -> Path:
    """A file that one test process makes for all: an export takes seconds."""
    folder = temporary.getbasetemp()
    if "PYTEST_XDIST_WORKER" in os.environ:
        folder = folder.parent  # above the folders of the processes
    path = folder / "once" / name / name
    path.parent.mkdir(parents=True, exist_ok=True)
    with (folder / f"{name}.lock").open("w") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        return path if path.exists() else make(path)


@pytest.fixture(scope="session")
def checkpoint_file(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A checkpoint of a small, untrained network over three classes."""
    return made_once(
        "tiny.safetensors", lambda path: tiny_checkpoint(SMALL, path), tmp_path_factory
    )


@pytest.fixture(scope="session")
def model_file(checkpoint_file: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """That checkpoint as `meshconv3d export` writes it: `tiny.onnx`."""
    return made_once("tiny.onnx", lambda path: exported(checkpoint_file, path), tmp_path_factory)


@pytest.fixture(scope="session")
def whole_file(model_file: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The whole pipeline of that model file: `whole.onnx`."""
    return made_once(
        "whole.onnx", lambda path: exported(model_file, path, "--whole"), tmp_path_factory
    )


@pytest.fixture(scope="session")
def learned_file(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The same with learned pooling, which is a whole pipeline: `learned.onnx`."""

    def make(path: Path) -> Path:
        config = replace(SMALL, pooling="learned")
        checkpoint = tmp_path_factory.mktemp("learned") / "learned.safetensors"
        return exported(tiny_checkpoint(config, checkpoint), path)

    return made_once("learned.onnx", make, tmp_path_factory)
