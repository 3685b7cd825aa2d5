"""Table III: 50 batches of 50 meshes of SHREC11, forward and backward.

The paper's run times are of one GPU; these are of one thread of a processor. The variants take
turns, batch by batch, so that a disturbance meets all alike; a batch's topology is part of its
time. Memory is the peak of a step above what the process held before it, in a process of its own.
"""

import json
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import torch
from torch import nn

from benchmarks import training_step
from benchmarks.measuring import apart, peak_memory, yardstick
from meshconv3d.model.config import preset
from meshconv3d.model.datasets import class_names, find_samples
from meshconv3d.model.files import write_whole
from meshconv3d.model.loading import load_mesh
from meshconv3d.model.mesh import Mesh
from meshconv3d.model.nn.network import Network, as_tensors
from meshconv3d.model.preparation import prepare
from meshconv3d.model.topology.inputs import collate, input_names, mesh_inputs

RESULT = Path(__file__).parents[1] / "results" / "paper_cost.json"
BATCHES, MESHES = 50, 50
# By title, the preset and its forward pass, one of `training_step`.
VARIANTS = {
    "paper": ("paper", "ours"),
    "default": ("default", "ours"),
    "default in plain torch": ("default", "plain torch"),
}
Labelled = list[tuple[Mesh, int]]


def read() -> dict[str, Any]:
    """What was measured."""
    return json.loads(RESULT.read_text())


def measure(
    data: Path, result: Path = RESULT, batches: int = BATCHES, meshes: int = MESHES
) -> None:
    """Measure all variants on a data set and keep the figures as JSON."""
    times = apart(step_times, data, batches, meshes)
    memory = {title: apart(step_memory, title, data, meshes) for title in VARIANTS}
    found: dict[str, Any] = {
        "batches": batches,
        "meshes": meshes,
        "yardsticks": {title: times[title] / times["yardstick"] for title in VARIANTS},
        "megabytes": memory,
    }
    write_whole(result, (json.dumps(found, indent=1) + "\n").encode())


def step_times(data: Path, batches: int, meshes: int) -> dict[str, float]:
    """Seconds of processor time of a step by variant, and of a yardstick: the least of all
    batches, which are of one size; what else a machine does only ever adds to a time."""
    yard = yardstick()
    drawn, classes = draw(data, batches, meshes)
    steps = {title: step(title, classes) for title in VARIANTS}
    for one in steps.values():
        one(drawn[0][:2])  # compiles and loads
    times = dict.fromkeys(["yardstick", *VARIANTS], float("inf"))
    for batch in drawn:
        times["yardstick"] = min(times["yardstick"], _seconds(yard))
        for title, one in steps.items():
            seconds = _seconds(lambda one=one, batch=batch: one(batch))
            times[title] = min(times[title], seconds)
    return times


def step_memory(title: str, data: Path, meshes: int) -> float:
    """MB of one step of a variant, in this process."""
    torch.set_num_threads(1)
    (batch,), classes = draw(data, 1, meshes)
    one = step(title, classes)
    one(batch[:2])
    with peak_memory() as peak:
        one(batch)
    return round(peak.megabytes, 1)


def draw(data: Path, batches: int, meshes: int) -> tuple[list[Labelled], tuple[str, ...]]:
    """Batches of prepared meshes with their class numbers, drawn with seed 0, and the classes."""
    samples = find_samples(data)
    classes = class_names(samples)
    budget = preset("paper", classes).face_budget
    rng = np.random.default_rng(0)
    chosen = [rng.choice(len(samples), meshes, replace=False) for _ in range(batches)]
    prepared = {
        number: (
            prepare(load_mesh(samples[number].path), budget)[0],
            classes.index(samples[number].label),
        )
        for number in np.unique(chosen).tolist()
    }
    return [[prepared[number] for number in batch.tolist()] for batch in chosen], classes


def step(title: str, classes: tuple[str, ...]) -> Callable[[Labelled], None]:
    """A training step of a variant without the optimiser's, from prepared meshes to gradients."""
    name, variant = VARIANTS[title]
    config, forward = preset(name, classes), training_step.VARIANTS[variant]
    network = Network(config).train()
    loss = nn.CrossEntropyLoss()

    def run(batch: Labelled) -> None:
        arrays = as_tensors(collate([mesh_inputs(mesh, config) for mesh, _ in batch]))
        labels = torch.tensor([label for _, label in batch])
        network.zero_grad()
        by_name = dict(zip(input_names(config), arrays, strict=True))
        loss(forward(network, by_name), labels).backward()

    return run


def _seconds(call: Callable[[], object]) -> float:
    started = time.process_time()
    call()
    return time.process_time() - started
