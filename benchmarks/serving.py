"""What one machine serves: `python -m benchmarks.serving`.

Three tables in one run. The pipeline alone, from the bytes of a 500-face binary STL to scores, in
several processes, several threads, several meshes to one run of the graph, and with one or two
threads inside onnxruntime. Then the same mesh over HTTP, as a share of the pipeline in processes.
Then ten times that rate for a minute: what is still answered, how fast, and in how much memory.
"""

import argparse
import multiprocessing
import os
import platform
import socket
import subprocess
import sys
import threading
import time
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from dataclasses import dataclass

import numpy as np
import trimesh

from benchmarks.http_load import Tally, drive
from benchmarks.processes import memory_of
from export.runtime import onnxruntime
from model.inputs import collate, mesh_inputs
from model.loading import load_mesh
from model.preparation import prepare
from model.samples import sample_paths
from service.models import DEFAULT_MODEL, ModelFile

CORES = len(os.sched_getaffinity(0))
# Enough to keep the workers busy, and for overload, far more than are answered at a time.
CONNECTIONS = 4 * CORES
MANY_CONNECTIONS = 900


@dataclass(frozen=True)
class Design:
    """A way to use the machine. batch: meshes to one run of the graph; intra_op: threads inside
    onnxruntime for one run."""

    processes: int
    threads: int
    batch: int
    intra_op: int


DESIGNS = [
    Design(processes, threads, batch, intra_op)
    for processes, threads, batch in [
        (1, 1, 1),
        (CORES, 1, 1),
        (1, CORES, 1),
        (1, 1, 4),
        (1, 1, 16),
        (CORES, 1, 4),
    ]
    for intra_op in (1, 2)
]


def binary_stl() -> bytes:
    """A sample of 500 faces as a binary STL."""
    mesh = load_mesh(sample_paths()["ants"])
    stl = trimesh.Trimesh(mesh.vertices, mesh.faces, process=False).export(file_type="stl")
    assert isinstance(stl, bytes)
    return stl


def meshes_per_second(design: Design, content: bytes, seconds: float) -> float:
    """How many meshes a design classifies, from bytes to scores, all its processes at a time."""
    context = multiprocessing.get_context("spawn")
    barrier = context.Barrier(design.processes)
    with context.Pool(design.processes, _join, (barrier,)) as pool:
        jobs = [(design, content, seconds)] * design.processes
        return sum(pool.starmap(_work, jobs, chunksize=1))


def _join(barrier) -> None:
    global _barrier
    _barrier = barrier


def _work(design: Design, content: bytes, seconds: float) -> float:
    model = ModelFile.read(DEFAULT_MODEL)
    config = model.open().card.config
    options = onnxruntime.SessionOptions()
    options.intra_op_num_threads = design.intra_op
    session = onnxruntime.InferenceSession(model.content, options)

    def run_once() -> None:
        batch = []
        for _ in range(design.batch):
            mesh, _ = prepare(load_mesh(content, "stl"), config.face_budget)
            batch.append(mesh_inputs(mesh, config))
        session.run(["scores", "novelty"], collate(batch))

    def run_until(end: float) -> int:
        runs = 0
        while time.perf_counter() < end:
            run_once()
            runs += 1
        return runs

    run_once()
    _barrier.wait()
    end = time.perf_counter() + seconds
    with ThreadPoolExecutor(design.threads) as pool:
        runs = sum(pool.map(run_until, [end] * design.threads))
    return runs * design.batch / seconds


def compare_designs(content: bytes, seconds: float) -> float:
    """Print what every design does; the rate of one mesh to a process."""
    print("\nThe pipeline alone    processes  threads  batch  intra-op    meshes/s")
    rates = {}
    for design in DESIGNS:
        rates[design] = meshes_per_second(design, content, seconds)
        d = design
        row = f"{d.processes:>9}{d.threads:>9}{d.batch:>7}{d.intra_op:>10}{rates[d]:>12.0f}"
        print(" " * 22 + row, flush=True)
    return rates[Design(CORES, 1, 1, 1)]


@contextmanager
def service() -> Iterator[tuple[int, int]]:
    """A running service with its default settings: its port and its process id."""
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        port = probe.getsockname()[1]
    main = "from service.cli.main import main; main()"
    process = subprocess.Popen(
        [sys.executable, "-c", main, "serve", "--port", str(port)], stderr=subprocess.DEVNULL
    )
    try:
        while not _listens(port):
            if process.poll() is not None:
                raise RuntimeError(f"the service ended with {process.returncode}")
            time.sleep(0.1)
        yield port, process.pid
    finally:
        process.terminate()
        process.wait()


def _listens(port: int) -> bool:
    with socket.socket() as attempt:
        return attempt.connect_ex(("127.0.0.1", port)) == 0


def post(content: bytes) -> bytes:
    """The request that is sent over and over."""
    head = "POST /v1/classify HTTP/1.1\r\nHost: a\r\nContent-Type: model/stl\r\n"
    return f"{head}Content-Length: {len(content)}\r\n\r\n".encode() + content


def over_http(port: int, content: bytes, pipeline: float, seconds: float) -> float:
    """Print the rate of the service, all workers busy, beside that of the pipeline."""
    drive(port, post(content), CONNECTIONS, 2.0)
    tally = drive(port, post(content), CONNECTIONS, seconds)
    rate = tally.rate(200)
    print(f"\nOver HTTP, {CONNECTIONS} kept connections: {rate:.0f} meshes/s, ", end="")
    print(f"{rate / pipeline:.0%} of the pipeline's {pipeline:.0f}; {_latency(tally)}", flush=True)
    return rate


def overload(port: int, process: int, content: bytes, best: float, seconds: float) -> None:
    """Print what the service does at ten times its best rate."""
    peaks = [memory_of(process)]
    over = threading.Event()

    def watch() -> None:
        while not over.wait(1.0):
            peaks.append(memory_of(process))

    watcher = threading.Thread(target=watch)
    watcher.start()
    tally = drive(port, post(content), MANY_CONNECTIONS, seconds, rate=10 * best)
    over.set()
    watcher.join()
    offered = tally.statuses.total() / tally.seconds
    print(f"\nOverload for {tally.seconds:.0f} s: {10 * best:.0f} requests/s wanted, ", end="")
    print(f"{offered:.0f} taken off the {MANY_CONNECTIONS} connections")
    for status, count in sorted(tally.statuses.items()):
        print(f"  {status if status > 0 else 'closed':>6}{count:>9}{tally.rate(status):>9.0f}/s")
    print(f"  accepted: {tally.rate(200) / best:.0%} of the best rate; {_latency(tally)}")
    print(f"  memory of all processes: {peaks[0]:.0f} MB before, at most {max(peaks):.0f} MB")


def _latency(tally: Tally) -> str:
    median, p95, p99 = np.percentile(tally.latencies, [50, 95, 99]) * 1000
    return f"latency {median:.0f} ms in the middle, p95 {p95:.0f}, p99 {p99:.0f}"


def main() -> None:
    parser = argparse.ArgumentParser(description="What one machine serves.")
    parser.add_argument("--seconds", type=float, default=5.0, help="for each rate")
    parser.add_argument("--overload-seconds", type=float, default=60.0)
    arguments = parser.parse_args()
    content = binary_stl()
    print(f"{platform.machine()}, {CORES} cores, Python {platform.python_version()}, ", end="")
    print(f"onnxruntime {onnxruntime.__version__}; load before: {os.getloadavg()[0]:.1f}")
    pipeline = compare_designs(content, arguments.seconds)
    with service() as (port, process):
        best = over_http(port, content, pipeline, arguments.seconds)
        overload(port, process, content, best, arguments.overload_seconds)


if __name__ == "__main__":
    main()
