"""Whole pipelines beside the package: `python -m benchmarks.whole MODEL DATA [--split FILE]`.

Takes the meshes of a folder that no training saw, or so many drawn at random, through the package's
preparation. Of each it compares the network's indices in the whole pipeline (`meshconv3d export
--whole`) with the kernels', and the scores with the model file's. It also tells what the pipeline
costs, in time of one core. With --javascript, it also tells how often the preparation in
examples/javascript leads to the package's best class; with --page, how often that of the page,
which reads the files itself, gives the package's mesh and its best class.
"""

import argparse
import base64
import json
import subprocess
import tempfile
import time
from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np
import onnx
from numpy.typing import NDArray

from meshconv3d.export.comparison import OUTPUTS
from meshconv3d.export.runtime import open_session
from meshconv3d.export.whole.parity import other_indices
from meshconv3d.export.whole.pipeline import OWN, join, topology_model
from meshconv3d.model.config import NetworkConfig
from meshconv3d.model.datasets import find_samples
from meshconv3d.model.errors import MeshError
from meshconv3d.model.loading import load_mesh
from meshconv3d.model.mesh import Mesh
from meshconv3d.model.preparation import prepare
from meshconv3d.model.topology.inputs import collate, mesh_inputs, whole_inputs
from meshconv3d.service.models import ModelFile

MOST_TIMES = 4.0
MOST_BYTES = 200_000
# Meshes, of all, on which time is taken.
TIMED = 50
ROOT = Path(__file__).parents[1]
ANY_MESH = ROOT / "examples" / "javascript" / "any-mesh.js"
PAGE = ROOT / "page" / "prepare.js"


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    parser.add_argument("model")
    parser.add_argument("data", type=Path)
    parser.add_argument("--split", type=Path)
    parser.add_argument("--count", type=int, default=500)
    parser.add_argument("--javascript", action="store_true")
    parser.add_argument("--page", action="store_true")
    arguments = parser.parse_args()
    pipelines = Pipelines(ModelFile.read(arguments.model))
    samples = [s for s in find_samples(arguments.data, arguments.split) if s.split != "train"]
    raw: list[Mesh] = []
    paths: list[Path] = []
    for i in np.random.default_rng(0).permutation(len(samples)):
        if len(raw) == arguments.count:
            break
        try:
            mesh = load_mesh(samples[i].path)
            prepared, _ = prepare(mesh, pipelines.config.face_budget)
        except MeshError:
            continue
        raw.append(mesh)
        paths.append(samples[i].path)
        pipelines.compare(prepared, samples[i].path)
    pipelines.tell()
    if arguments.javascript:
        answers = javascript_answers(pipelines.content, raw)
        same = sum(map(str.__eq__, answers, pipelines.answers))
        print(f"{same:8} with the same best class, prepared by JavaScript")
    if arguments.page:
        found = page_meshes(paths, pipelines.config.face_budget)
        identical = sum(map(is_same, found, pipelines.prepared))
        print(f"{identical:8} that the page prepares alike, number for number")
        answers = [mesh and pipelines.best(mesh) for mesh in found]
        same = sum(map(str.__eq__, pipelines.answers, map(str, answers)))
        print(f"{same:8} with the same best class, prepared by the page")


class Pipelines:
    """A model and its whole pipeline, and what was found so far, an entry for each mesh."""

    def __init__(self, model: ModelFile) -> None:
        opened = model.open()
        self.model, self.config = opened.session, opened.card.config
        proto = onnx.load_model_from_string(model.content)
        topology = topology_model(self.config, proto)
        whole = join(topology, proto, self.config)
        # With the indices among the outputs, not to compute them twice.
        observed = onnx.ModelProto()
        observed.CopyFrom(whole)
        observed.graph.output.extend(topology.graph.output)
        self.observing = open_session(observed.SerializeToString())
        whole.metadata_props.extend(proto.metadata_props)
        self.content = whole.SerializeToString()
        self.added = len(self.content) - len(model.content)
        self.whole = open_session(self.content)
        self.prepared: list[Mesh] = []
        self.answers: list[str] = []
        self.same: list[bool] = []
        self.differences: list[float] = []
        self.times: list[tuple[float, float]] = []

    def compare(self, mesh: Mesh, path: Path) -> None:
        """Compare on a prepared mesh; path: that of its file."""
        inputs = whole_inputs(mesh)
        names = [output.name.removeprefix(OWN) for output in self.observing.get_outputs()]
        arrays = map(np.asarray, self.observing.run(None, inputs))
        found = dict(zip(names, arrays, strict=True))
        others = other_indices(found, kernel_inputs(mesh, self.config))
        if others:
            print(f"{path}: other {', '.join(others)}")
        scores = self.scores(mesh)
        self.prepared.append(mesh)
        self.answers.append(self.config.classes[scores.argmax()])
        self.same.append(not others)
        self.differences.append(float(np.abs(found["scores"][0] - scores).max()))
        if len(self.times) < TIMED:
            self.times.append(
                (
                    seconds(lambda: self.whole.run(OUTPUTS, inputs)),
                    seconds(lambda: self.model.run(OUTPUTS, kernel_inputs(mesh, self.config))),
                )
            )

    def scores(self, mesh: Mesh) -> NDArray[np.float32]:
        """N_c scores by kernels and model file."""
        return np.asarray(self.model.run(["scores"], kernel_inputs(mesh, self.config))[0])[0]

    def best(self, mesh: Mesh) -> str:
        """The best class of a prepared mesh."""
        return self.config.classes[self.scores(mesh).argmax()]

    def tell(self) -> None:
        whole, apart = np.array(self.times).T
        print(f"{len(self.same):8} meshes")
        print(f"{sum(self.same):8} with the indices of the kernels")
        print(f"{max(self.differences):8.1e} largest difference of a score")
        ratio = whole.sum() / apart.sum()
        print(f"{ratio:8.2f} time over topology and model (at most {MOST_TIMES:g})")
        print(f"{self.added / 1e3:8.0f} kB added (at most {MOST_BYTES / 1e3:g})", flush=True)


def javascript_answers(content: bytes, meshes: Sequence[Mesh]) -> list[str]:
    """The best class of each mesh as it was read, by the examples for Node.js."""
    with tempfile.TemporaryDirectory() as folder:
        whole = Path(folder, "whole.onnx")
        whole.write_bytes(content)
        paths = [Path(folder, f"{i}.off") for i in range(len(meshes))]
        for path, mesh in zip(paths, meshes, strict=True):
            with path.open("w") as file:
                file.write(f"OFF\n{len(mesh.vertices)} {len(mesh.faces)} 0\n")
                np.savetxt(file, mesh.vertices, "%.9g")
                np.savetxt(file, mesh.faces, "3 %d %d %d")
        done = subprocess.run(
            ["node", ANY_MESH, whole, *paths], capture_output=True, text=True, check=True
        )
    return [line.rpartition(" ")[0] for line in done.stdout.splitlines()]


def page_meshes(paths: Sequence[Path], budget: int) -> list[Mesh | None]:
    """What the page makes of files; None where it refuses one."""
    command = ["node", PAGE, str(budget), *paths]
    done = subprocess.run(command, capture_output=True, text=True, check=True)
    found = [json.loads(line).get("prepared") for line in done.stdout.splitlines()]

    def array(text: str, dtype: type) -> NDArray:
        return np.frombuffer(base64.b64decode(text), dtype).reshape(-1, 3)

    return [
        one and Mesh(array(one["vertices"], np.float64), array(one["faces"], np.int32))
        for one in found
    ]


def is_same(found: Mesh | None, mesh: Mesh) -> bool:
    """Whether vertices and faces are the same, bit for bit."""
    return (
        found is not None
        and np.array_equal(found.vertices, mesh.vertices)
        and np.array_equal(found.faces, mesh.faces)
    )


def kernel_inputs(mesh: Mesh, config: NetworkConfig) -> dict[str, NDArray]:
    """The inputs of the model file for a prepared mesh."""
    return collate([mesh_inputs(mesh, config)])


def seconds(call: Callable[[], object]) -> float:
    """Time of the processor that a call takes."""
    begin = time.process_time()
    call()
    return time.process_time() - begin


if __name__ == "__main__":
    main()
