"""The executor over a Ray cluster: what it gives, whatever becomes of the nodes."""

import json
import os
import shutil
import time
from collections.abc import Collection, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pytest

from meshconv3d.model.loading import Limits
from meshconv3d.service.batch.files import File
from meshconv3d.service.batch.listing import Listing
from meshconv3d.service.batch.running import (
    ExecutorFailed,
    FileResult,
    Options,
    SerialExecutor,
)
from meshconv3d.service.classifier import Classifier
from meshconv3d.service.models import ModelFile
from meshconv3d.service.records import record
from meshconv3d.service.workers import Setup, predict
from tests.commands import meshconv3d

pytest.importorskip("ray", reason="needs the extra `ray`")

import ray
from ray.cluster_utils import Cluster

from meshconv3d.service.batch.ray_engine import BLOCK, RayExecutor

ROOT = Path(__file__).parents[3]
# The least that Ray takes, in bytes.
OBJECT_STORE = 80 * 2**20
MEMORY = 2**29
OPTIONS = Options("tiny", MEMORY)


@dataclass(frozen=True)
class Nodes:
    """A cluster of two nodes with one CPU each."""

    cluster: Cluster
    other: object

    @property
    def address(self) -> str:
        return str(self.cluster.address)


@pytest.fixture(scope="module")
def nodes() -> Iterator[Nodes]:
    node: dict[str, Any] = {"num_cpus": 1, "object_store_memory": OBJECT_STORE}
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("PYTHONPATH", str(ROOT))  # where the nodes find what runs here
        cluster = Cluster(initialize_head=True, head_node_args=node | {"include_dashboard": False})
        yield Nodes(cluster, cluster.add_node(**node))
        ray.shutdown()
        cluster.shutdown()


@pytest.fixture(scope="module")
def setup(model_file: Path) -> Setup:
    return Setup([ModelFile.read(str(model_file))], Limits(), MEMORY, seconds=30.0)


@pytest.fixture
def serial(model_file: Path) -> SerialExecutor:
    classifier = Classifier.load(str(model_file))
    return SerialExecutor(lambda task: predict(task, classifier, False), OPTIONS)


@dataclass(frozen=True)
class Noted(File):
    """A file that takes its time, and leaves the node that read it as a file in `notes`."""

    file: File
    notes: Path

    def read(self) -> bytes:
        time.sleep(0.05)
        node = ray.get_runtime_context().get_node_id()
        (self.notes / f"{self.name} {node} {time.monotonic_ns()}").touch()
        return self.file.read()

    def pieces(self, content: bytes) -> dict[str, bytes]:
        return self.file.pieces(content)


def never(_: str) -> Collection[str]:
    return ()


def timeless(one: FileResult) -> dict:
    found = record(one.file.name, one.result, 1)
    return found.model_dump(mode="json", by_alias=True) | {"timings_ms": None}


def test_the_command_writes_and_resumes_what_the_local_one_does(
    nodes: Nodes, model_file: Path, meshes: Path, tmp_path: Path
) -> None:
    """In the order of the files, of several blocks, and without what is done."""
    for number in range(14):
        shutil.copytree(meshes, tmp_path / "many" / f"{number:02}")
    path = tmp_path / "all.jsonl"
    command = ("batch", tmp_path / "many", "--model", model_file, "--output", path)
    local = meshconv3d(*command, "--workers", 1)
    whole = timeless_records(path)
    assert len(whole) == 14 * 5 > 2 * BLOCK
    path.write_text("".join(path.read_text().splitlines(keepends=True)[:2]))
    done = meshconv3d(*command, "--resume", "--ray", nodes.address)
    assert (done.returncode, done.stdout) == (local.returncode, "") == (1, "")
    assert "2 of them earlier" in done.stderr
    assert "Traceback" not in done.stderr
    assert timeless_records(path) == whole


def timeless_records(path: Path) -> list[dict]:
    return [json.loads(line) | {"timings_ms": None} for line in path.read_text().splitlines()]


@pytest.mark.parametrize(
    ("address", "reason"),
    [("127.0.0.1:1", "no Ray cluster answers"), ("ray://127.0.0.1:1", "give HOST:PORT")],
)
def test_an_address_without_a_cluster(setup: Setup, address: str, reason: str) -> None:
    with pytest.raises(ExecutorFailed, match=reason):
        RayExecutor(setup, None, address, OPTIONS)


def test_nothing_phones_home() -> None:
    from ray._common.usage.usage_lib import usage_stats_enabled

    assert os.environ["RAY_USAGE_STATS_ENABLED"] == "0"
    assert not usage_stats_enabled()


def test_a_lost_node_loses_nothing_and_gives_nothing_twice(
    nodes: Nodes, setup: Setup, serial: SerialExecutor, meshes: Path, tmp_path: Path
) -> None:
    (ring,) = Listing([str(meshes / "ring.obj")])
    files = [Noted(f"{number:04}.obj", "", ".obj", ring, tmp_path) for number in range(8 * BLOCK)]
    found = []
    with RayExecutor(setup, 2, nodes.address, OPTIONS) as executor:
        for one in executor.results(files, never):
            found.append(timeless(one))
            if nodes.other in nodes.cluster.worker_nodes and len(readers(tmp_path)) == 2:
                lost = len(found)
                nodes.cluster.remove_node(nodes.other, allow_graceful=False)
    assert 0 < lost < len(files)
    reads = [note.name.split()[0] for note in tmp_path.iterdir()]
    assert len(reads) > len(set(reads)) == len(files)  # what was lost was done again
    found.sort(key=lambda record: record["file"])
    assert found == [timeless(one) for one in serial.results(files[:1], never)] + [
        found[0] | {"file": file.name} for file in files[1:]
    ]


def readers(notes: Path) -> set[str]:
    """The nodes that have read something."""
    return {note.name.split()[1] for note in notes.iterdir()}
