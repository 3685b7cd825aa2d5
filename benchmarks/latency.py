"""Time and memory of each stage: `python -m benchmarks.latency`.

Three tables in one run: the stages of one 500-face mesh on one thread; the topology stage from
500 to a million faces; the exported graph under onnxruntime against the same network in torch
eager mode, with a product of two 1024 x 1024 float32 matrices as the yardstick. Times are the
median of many repetitions after warm-up.
"""

import argparse
import platform
import resource
import statistics
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np
import torch
import trimesh

from export.runtime import onnxruntime
from model.checkpoint import load_checkpoint
from model.config import NetworkConfig
from model.descriptors import pooling_features
from model.inputs import collate, mesh_inputs, terms_of
from model.loading import load_mesh
from model.mesh import Mesh
from model.network import Network, as_tensors
from model.preparation import prepare
from model.samples import sample_paths
from model.topology import Surface, build_topology
from model.topology.halfedges import find_twins, sort_adjacency
from model.topology.patches import grow_patches
from model.topology.pooling import pool_faces
from service.models import open_model


def measure(call: Callable[[], object], seconds: float = 1.0) -> float:
    """Median milliseconds of a call, after one to warm up, repeated for about `seconds`."""
    call()
    times: list[float] = []
    while sum(times) < seconds or len(times) < 3:
        started = time.perf_counter()
        call()
        times.append(time.perf_counter() - started)
    return statistics.median(times) * 1000


def torus(faces: int) -> Mesh:
    """A closed torus of this many faces, or a few less, irregular enough to have no exact ties."""
    sides = round((faces / 5) ** 0.5)
    shape = trimesh.creation.torus(1.0, 0.4, faces // (2 * sides), sides)
    noise = np.random.default_rng(0).normal(0, 0.1 / sides, shape.vertices.shape)
    return Mesh(shape.vertices + noise, shape.faces)


def stages(config: NetworkConfig, model_name: str) -> None:
    """Print the time of every stage for one sample of exactly the face budget."""
    path = next(p for p in sample_paths().values() if len(load_mesh(p).faces) == config.face_budget)
    content = path.read_bytes()
    loaded = load_mesh(content, path.name)
    mesh, _ = prepare(loaded, config.face_budget)
    surface = Surface.of(mesh)
    features = pooling_features(mesh.vertices, mesh.faces)
    adjacency = sort_adjacency(surface.twin, surface.lengths)
    inputs = mesh_inputs(mesh, config)
    arrays = collate([inputs])
    session = open_model(model_name).session
    rows = {
        f"read ({path.name}, {len(content) / 1000:.0f} kB)": lambda: load_mesh(content, path.name),
        "prepare": lambda: prepare(loaded, config.face_budget),
        "topology + descriptors": lambda: mesh_inputs(mesh, config),
        "  twins": lambda: find_twins(mesh.faces, len(mesh.vertices)),
        "  descriptor terms": lambda: terms_of(mesh.vertices, mesh.faces, surface, config),
        f"  patches, K = {config.patch_size}": lambda: grow_patches(adjacency, config.patch_size),
        f"  one pooling, to {config.targets[0]}": lambda: pool_faces(
            surface.twin, features, config.targets[0], True, True
        ),
        "collate": lambda: collate([inputs]),
        "graph (onnxruntime)": lambda: session.run(["scores"], arrays),
    }
    print(f"\nOne mesh of {len(mesh.faces)} faces, one thread         ms")
    for title, call in rows.items():
        print(f"  {title:42} {measure(call):8.3f}")


def growth(config: NetworkConfig, sizes: list[int]) -> None:
    """Print the topology stage's time against the face count, and its fitted exponent."""
    print("\nTopology against faces              ms   us/face   peak memory, MB")
    counts, times = [], []
    for size in sizes:
        mesh = torus(size)
        targets = [int(len(mesh.faces) * t / config.face_budget) for t in config.targets]

        def build(mesh: Mesh = mesh, targets: list[int] = targets) -> None:
            surface = Surface.of(mesh)
            terms_of(mesh.vertices, mesh.faces, surface, config)
            features = pooling_features(mesh.vertices, mesh.faces)
            build_topology(surface, features, config.patch_size, targets)

        elapsed = measure(build)
        counts.append(len(mesh.faces))
        times.append(elapsed)
        peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
        each = elapsed * 1000 / counts[-1]
        print(f"  {counts[-1]:>12,} faces {elapsed:14.2f} {each:9.3f} {peak:14.0f}")
    exponent = np.polyfit(np.log(counts), np.log(times), 1)[0]
    print(f"  time grows as faces^{exponent:.2f}")


def runtimes(config: NetworkConfig, checkpoint: Path | None, model_name: str) -> None:
    """Print onnxruntime against torch eager on the same mesh, in one run."""
    torch.set_num_threads(1)
    network = load_checkpoint(checkpoint).network if checkpoint else Network(config).eval()
    path = next(iter(sample_paths().values()))
    arrays = collate([mesh_inputs(prepare(load_mesh(path), config.face_budget)[0], config)])
    tensors = as_tensors(arrays)
    session = open_model(model_name).session
    square = np.random.default_rng(0).random((1024, 1024), dtype=np.float32)
    yardstick = torch.from_numpy(square)

    def eager() -> None:
        with torch.inference_mode():
            network(*tensors)

    rows = {
        "onnxruntime, exported graph": lambda: session.run(["scores"], arrays),
        "torch eager": eager,
        "one 1024^3 float32 matrix product (torch)": lambda: yardstick @ yardstick,
    }
    print("\nThe graph alone, one mesh, one thread              ms")
    for title, call in rows.items():
        print(f"  {title:42} {measure(call):8.3f}")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    parser.add_argument("--model", default="shrec11", help="shipped model or model file")
    parser.add_argument("--checkpoint", type=Path, help="torch weights; random without")
    parser.add_argument("--largest", type=int, default=1_000_000, help="faces, for the growth")
    arguments = parser.parse_args()
    config = open_model(arguments.model).card.config
    print(
        f"{platform.processor() or platform.machine()}, Python {platform.python_version()}, "
        f"onnxruntime {onnxruntime.__version__}, torch {torch.__version__}"
    )
    stages(config, arguments.model)
    sizes = [size for size in (500, 1000, 10_000, 100_000, 1_000_000) if size <= arguments.largest]
    growth(config, sizes)
    runtimes(config, arguments.checkpoint, arguments.model)


if __name__ == "__main__":
    main()
