"""Throughput of one machine: `python -m benchmarks run serving`.

Three tables in one run. The pipeline alone, from the bytes of a 500-face binary STL to scores, in
several processes, several threads, several meshes to one run of the graph, and with one or two
threads inside onnxruntime. Then the same mesh over HTTP and through the pipeline, in turns.
Then ten times that rate for a minute: what is still answered, how fast, and in how much memory.
"""

import multiprocessing
import os
import threading
import time
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass

import numpy as np

from benchmarks.figures import MILLISECONDS, Findings, heading
from benchmarks.http_load import Tally, drive
from benchmarks.measuring import best, yardstick
from benchmarks.processes import memory_of
from benchmarks.running_service import service
from benchmarks.stages import OUTPUTS
from benchmarks.workloads import as_file, sample
from meshconv3d.export.runtime import onnxruntime, session_options
from meshconv3d.model.loading import load_mesh
from meshconv3d.model.preparation import prepare
from meshconv3d.model.topology.inputs import collate, mesh_inputs
from meshconv3d.service.models import ModelFile

CORES = len(os.sched_getaffinity(0))
# Enough to keep the workers busy, and for overload, far more than are answered at a time.
CONNECTIONS = 4 * CORES
MANY_CONNECTIONS = 900
SECONDS = 5.0  # for each rate
ROUNDS = 4
OVERLOAD_SECONDS = 60.0


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


def meshes_per_second(design: Design, content: bytes, model_name: str) -> float:
    """Meshes from bytes to scores per second in a design, with all its processes."""
    context = multiprocessing.get_context("spawn")
    barrier = context.Barrier(design.processes)
    with context.Pool(design.processes, _join, (barrier,)) as pool:
        jobs = [(design, content, model_name)] * design.processes
        return sum(pool.starmap(_work, jobs, chunksize=1))


def _join(barrier) -> None:
    global _barrier
    _barrier = barrier


def _work(design: Design, content: bytes, model_name: str) -> float:
    model = ModelFile.read(model_name)
    config = model.open().card.config
    options = session_options()
    options.intra_op_num_threads = design.intra_op
    session = onnxruntime.InferenceSession(model.content, options)

    def run_once() -> None:
        batch = []
        for _ in range(design.batch):
            mesh, _ = prepare(load_mesh(content, "stl"), config.face_budget)
            batch.append(mesh_inputs(mesh, config))
        session.run(OUTPUTS, collate(batch))

    def run_until(end: float) -> int:
        runs = 0
        while time.perf_counter() < end:
            run_once()
            runs += 1
        return runs

    run_once()
    _barrier.wait()
    end = time.perf_counter() + SECONDS
    with ThreadPoolExecutor(design.threads) as pool:
        runs = sum(pool.map(run_until, [end] * design.threads))
    return runs * design.batch / SECONDS


def compare_designs(content: bytes, model_name: str) -> None:
    """Print the rate of every design."""
    print("\nThe pipeline alone    processes  threads  batch  intra-op    meshes/s")
    for d in DESIGNS:
        rate = meshes_per_second(d, content, model_name)
        row = f"{d.processes:>9}{d.threads:>9}{d.batch:>7}{d.intra_op:>10}{rate:>12.0f}"
        print(" " * 22 + row, flush=True)


def post(content: bytes) -> bytes:
    """The request that is sent over and over."""
    head = "POST /v1/classify HTTP/1.1\r\nHost: a\r\nContent-Type: model/stl\r\n"
    return f"{head}Content-Length: {len(content)}\r\n\r\n".encode() + content


def over_http(port: int, content: bytes, model_name: str) -> tuple[float, float]:
    """Print the rate of the service, all workers busy, beside that of the pipeline in processes,
    in turns: a shared machine is not as fast at all times. Both rates."""
    drive(port, post(content), CONNECTIONS, 2.0)
    print(f"\nOver HTTP, {CONNECTIONS} kept connections     meshes/s  the pipeline's   share")
    rounds = []
    for _ in range(ROUNDS):
        pipeline = meshes_per_second(Design(CORES, 1, 1, 1), content, model_name)
        tally = drive(port, post(content), CONNECTIONS, SECONDS)
        rate = tally.rate(200)
        rounds.append((rate, pipeline))
        print(f"{rate:43.0f}{pipeline:16.0f}{rate / pipeline:8.0%}  {_latency(tally)}", flush=True)
    rate, pipeline = np.mean(rounds, axis=0).tolist()
    print(f"  in the mean: {rate:.0f} meshes/s, {rate / pipeline:.0%} of the pipeline's")
    return rate, pipeline


def overload(port: int, process: int, content: bytes, rate: float) -> float:
    """Print what the service does at ten times its best rate; the most memory it held, in MB."""
    peaks = [memory_of(process)]
    over = threading.Event()

    def watch() -> None:
        while not over.wait(1.0):
            peaks.append(memory_of(process))

    watcher = threading.Thread(target=watch)
    watcher.start()
    tally = drive(port, post(content), MANY_CONNECTIONS, OVERLOAD_SECONDS, rate=10 * rate)
    over.set()
    watcher.join()
    offered = tally.statuses.total() / tally.seconds
    print(f"\nOverload for {tally.seconds:.0f} s: {10 * rate:.0f} requests/s wanted, ", end="")
    print(f"{offered:.0f} taken off the {MANY_CONNECTIONS} connections")
    for status, count in sorted(tally.statuses.items()):
        print(f"  {status if status > 0 else 'closed':>6}{count:>9}{tally.rate(status):>9.0f}/s")
    print(f"  accepted: {tally.rate(200) / rate:.0%} of the best rate; {_latency(tally)}")
    print(f"  memory of all processes: {peaks[0]:.0f} MB before, at most {max(peaks):.0f} MB")
    return max(peaks)


def _latency(tally: Tally) -> str:
    median, p95, p99 = np.percentile(tally.latencies, [50, 95, 99]) * 1000
    return f"latency {median:.0f} ms in the middle, p95 {p95:.0f}, p99 {p99:.0f}"


def run(model_name: str) -> Findings:
    """Measure and print; the model by name or file."""
    findings = Findings(best({"yardstick": yardstick()})["yardstick"])
    content = as_file(sample(), "stl")
    print(f"\nload before: {os.getloadavg()[0]:.1f}")
    compare_designs(content, model_name)
    with service(model_name) as started:
        rate, pipeline = over_http(started.port, content, model_name)
        held = overload(started.port, started.process, content, rate)
    heading(f"A mesh on {CORES} cores")
    findings.add("in processes, a mesh", 1000 / pipeline, MILLISECONDS)
    findings.add("over HTTP, a mesh", 1000 / rate, MILLISECONDS)
    findings.add("memory of all processes, overloaded", held, "MB")
    return findings
