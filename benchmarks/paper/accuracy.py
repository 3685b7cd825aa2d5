"""Accuracy of Tables I and II: networks trained by `meshconv3d train`, over several seeds.

The protocol is the paper's, without anything that it does not mention: all meshes of the training
split are trained on, the last epoch's weights are scored once on the test split, and nothing is
chosen by it. Each run's result is kept in benchmarks/results/paper.json as it arrives; an
interrupted run goes on where it stopped, and a finished one is only read.
"""

import json
import subprocess
import sys
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from meshconv3d.model.files import write_whole
from meshconv3d.model.nn.checkpoint import load_checkpoint

RESULT = Path(__file__).parent.parent / "results" / "paper.json"
# A network by its title, as options of `meshconv3d train`.
PAPER = ("--preset", "paper", "--copies", "0")
DEFAULT = ("--preset", "default", "--copies", "10")
OBJECTS = ("--preset", "objects", "--copies", "0")
LITERAL = {"paper": PAPER, "default": DEFAULT}
# All else is the same for every network.
COMMON = ("--hold-out", "0", "--threads", "1")


@dataclass(frozen=True)
class Protocol:
    """One accuracy of the paper, and how it is measured here.

    published: the paper's accuracy. options: of `meshconv3d train`, for all networks. networks: by
    title, the options of each.
    """

    title: str
    published: float
    options: tuple[str, ...]
    networks: dict[str, tuple[str, ...]]

    def command(self, data: Path, network: str, seed: int) -> list[str]:
        """The command of one run, but for its folder."""
        options = (*self.networks[network], *self.options, *COMMON, "--seed", str(seed))
        return ["meshconv3d", "train", str(data), *options]


# Split 10 has as many training steps as split 16: its epochs are shorter.
SHREC11 = (
    Protocol("SHREC11, split 16", 1.0, ("--epochs", "35"), LITERAL),
    Protocol("SHREC11, split 10", 1.0, ("--split", "random:10", "--epochs", "56"), LITERAL),
)

Results = dict[str, dict[str, dict[str, Any]]]


def read_results() -> Results:
    """All results so far: by protocol, network and seed."""
    return json.loads(RESULT.read_text()) if RESULT.exists() else {}


def measure(protocols: tuple[Protocol, ...], data: Path, runs: Path, seeds: list[int]) -> None:
    """Train and score every network in every protocol, one seed after the other."""
    for seed in seeds:
        for protocol in protocols:
            for network in protocol.networks:
                if str(seed) in read_results().get(protocol.title, {}).get(network, {}):
                    continue
                row = run(protocol, data, runs, network, seed)
                done = read_results()
                done.setdefault(protocol.title, {}).setdefault(network, {})[str(seed)] = row
                write_whole(RESULT, (json.dumps(done, indent=1) + "\n").encode())
                print(f"{protocol.title}, {network}, seed {seed}: {row['test']:.2%}", flush=True)


def run(protocol: Protocol, data: Path, runs: Path, network: str, seed: int) -> dict[str, Any]:
    """Train one network, in a process of its own; what it came to."""
    name = f"{protocol.title}-{network}-seed{seed}".replace(",", "").replace(" ", "-").lower()
    command = protocol.command(data, network, seed)
    subprocess.run([*command, "--out", str(runs / name)], check=True, stdout=sys.stderr)
    training = load_checkpoint(runs / name / "model.safetensors").training
    log = [json.loads(line) for line in (runs / name / "log.jsonl").read_text().splitlines()]
    return {
        "test": training["accuracy"]["test"],
        "test_meshes": training["accuracy"]["test_meshes"],
        "train_meshes": training["data"]["train"],
        "minutes": round(sum(record["seconds"] for record in log) / 60, 1),
        "command": " ".join(["meshconv3d train", data.name, *command[3:]]),
    }
