"""One training step on 50 meshes of 500 faces: `python -m benchmarks run training_step`.

Forward and backward of the model's network on one thread, each variant in a process of its own: its
time, and its peak memory above what the process held before the step.
"""

from collections.abc import Callable

import torch
from torch import Tensor, nn

from benchmarks import peers, plain_network
from benchmarks.figures import MILLISECONDS, Findings, heading
from benchmarks.measuring import apart, best, peak_memory, yardstick
from benchmarks.workloads import sample
from meshconv3d.model.config import NetworkConfig
from meshconv3d.model.nn.network import Network, as_tensors
from meshconv3d.model.preparation import prepare
from meshconv3d.model.topology.inputs import collate, input_names, mesh_inputs
from meshconv3d.service.models import open_model

MESHES = 50
# Yardsticks and MB of a step, and what it may cost of a plain one.
STEP, STEP_MEGABYTES = 20, 350
OF_PLAIN, OF_PLAIN_MEMORY = 1 / 2, 1 / 3

Forward = Callable[[Network, dict[str, Tensor]], Tensor]


def _ours(network: Network, arrays: dict[str, Tensor]) -> Tensor:
    return network(*arrays.values()).scores


VARIANTS: dict[str, Forward] = {"ours": _ours, "plain torch": plain_network.scores}


def run(model_name: str) -> Findings:
    """Measure and print; the network's configuration is that of a model by name or file."""
    config = open_model(model_name).card.config
    measured = {name: apart(measure, config, name) for name in VARIANTS}
    ours, plain = measured["ours"], measured["plain torch"]
    findings = Findings(ours["yardstick"])
    heading(f"A training step on {MESHES} meshes of {config.face_budget} faces, one thread")
    for name, costs in measured.items():
        # Each in yardsticks of its own process.
        findings.add(name, costs["step"], MILLISECONDS)
        findings.add(f"{name}, peak memory", costs["megabytes"], "MB")
    cost = ours["step"] / ours["yardstick"]
    findings.add("ours, in yardsticks", cost, "yardsticks", STEP)
    findings.add("ours, memory", ours["megabytes"], "MB", STEP_MEGABYTES)
    of_plain = cost / (plain["step"] / plain["yardstick"])
    findings.add("time, of plain torch", of_plain, "of 1", OF_PLAIN)
    memory = ours["megabytes"] / plain["megabytes"]
    findings.add("memory, of plain torch", memory, "of 1", OF_PLAIN_MEMORY)
    peers.show(cost, "training_step")
    low, high = peers.TRAINING_GIGABYTES
    print(f"    with {low} to {high} GB of peak memory")
    return findings


def measure(config: NetworkConfig, variant: str) -> dict[str, float]:
    """Milliseconds and MB of one variant, in this process."""
    forward = VARIANTS[variant]
    network = Network(config).train()
    loss = nn.CrossEntropyLoss()

    def step(arrays: dict[str, Tensor], labels: Tensor) -> None:
        network.zero_grad()
        loss(forward(network, arrays), labels).backward()

    yard = yardstick()
    step(*batch(config, 2))  # loads what is loaded once
    network.zero_grad()
    whole = batch(config, MESHES)
    with peak_memory() as peak:
        step(*whole)
    times = best({"yardstick": yard, "step": lambda: step(*whole)}, seconds=5.0)
    return {**times, "megabytes": peak.megabytes}


def batch(config: NetworkConfig, meshes: int) -> tuple[dict[str, Tensor], Tensor]:
    """A batch of the sample mesh by input name, and labels."""
    inputs = mesh_inputs(prepare(sample(), config.face_budget)[0], config)
    tensors = as_tensors(collate([inputs] * meshes))
    arrays = dict(zip(input_names(config), tensors, strict=True))
    return arrays, torch.arange(meshes) % len(config.classes)
