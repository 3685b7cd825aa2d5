"""Accuracy over several seeds: `python -m benchmarks.accuracy DATA --out RUNS`.

Runs `meshconv3d train` once for each seed, with the protocol of the command's defaults: the last
epoch's weights are scored on the test split, once; nothing is chosen on it. With
`--train-per-class N`, every seed also makes a random split of its own, with N meshes of each class
to train on and the others to test on, whatever split the data comes in. Options that are not its
own go to `meshconv3d train`. An interrupted run goes on where it stopped, and a finished one is
only read. Prints a table and keeps it as JSON in benchmarks/results/.
"""

import argparse
import json
import statistics
import subprocess
import sys
from pathlib import Path
from typing import Any

from meshconv3d.model.nn.checkpoint import load_checkpoint

RESULTS = Path(__file__).parent / "results"


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    parser.add_argument("data", type=Path, help="folder laid out as CLASS/{train,test}/*.obj")
    parser.add_argument("--out", type=Path, default=Path("runs"), help="folder for the runs")
    parser.add_argument("--seeds", type=int, nargs="+", default=[0, 1, 2, 3, 4])
    parser.add_argument("--train-per-class", type=int, help="random splits of this size")
    arguments, training = parser.parse_known_args()

    name = arguments.data.name
    if arguments.train_per_class:
        name += f"-train{arguments.train_per_class}"
    rows = []
    for seed in arguments.seeds:
        folder = arguments.out / f"{name}-seed{seed}"
        if not (folder / "model.safetensors").exists():
            train(arguments.data, folder, seed, arguments.train_per_class, training)
        rows.append(row(folder, seed))
    summary = summarise(arguments.data.name, rows) | {"train_per_class": arguments.train_per_class}
    RESULTS.mkdir(exist_ok=True)
    (RESULTS / f"accuracy_{name}.json").write_text(json.dumps(summary, indent=2) + "\n")
    show(summary)


def train(
    data: Path, folder: Path, seed: int, train_per_class: int | None, training: list[str]
) -> None:
    """One run of the command, in a process of its own."""
    options = list(training)
    if train_per_class:
        options += ["--split", f"random:{train_per_class}"]
    # The order of additions, and with it the last digits of the weights, follows the threads: the
    # shipped weights were trained on one.
    options += ["--seed", str(seed), "--threads", "1"]
    command = ["meshconv3d", "train", str(data), "--out", str(folder), *options]
    subprocess.run(command, check=True, stdout=sys.stderr)


def row(folder: Path, seed: int) -> dict[str, Any]:
    """The record of one finished run."""
    training = load_checkpoint(folder / "model.safetensors").training
    epochs = [json.loads(line) for line in (folder / "log.jsonl").read_text().splitlines()]
    return {
        "seed": seed,
        "test_accuracy": training["accuracy"]["test"],
        "test_meshes": training["accuracy"]["test_meshes"],
        "train_meshes": training["data"]["train"],
        "epochs": len(epochs),
        "train_minutes": round(sum(record["seconds"] for record in epochs) / 60, 1),
    }


def summarise(data: str, rows: list[dict[str, Any]]) -> dict[str, Any]:
    accuracies = [row["test_accuracy"] for row in rows]
    return {
        "data": data,
        "selection": "last epoch",
        "mean": round(statistics.mean(accuracies), 5),
        "spread": round(max(accuracies) - min(accuracies), 5),
        "runs": rows,
    }


def show(summary: dict[str, Any]) -> None:
    print("seed  test accuracy  trained on  tested on  epochs  minutes")
    for row in summary["runs"]:
        print(
            f"{row['seed']:4}  {row['test_accuracy']:13.2%}  {row['train_meshes']:10}  "
            f"{row['test_meshes']:9}  {row['epochs']:6}  {row['train_minutes']:7}"
        )
    print(f"mean {summary['mean']:.2%}, spread {summary['spread']:.2%} (last epoch, no selection)")


if __name__ == "__main__":
    main()
