"""Accuracy over several seeds: `python -m benchmarks.accuracy DATA --out RUNS`.

Runs `meshconv3d train` once for each seed, with the protocol of the command's defaults: the last
epoch's weights are scored on the test split, once; nothing is chosen on it. An interrupted run
goes on where it stopped, and a finished one is only read. Prints a table and keeps it as JSON in
benchmarks/results/.
"""

import argparse
import json
import statistics
import subprocess
import sys
from pathlib import Path

from model.checkpoint import load_checkpoint

RESULTS = Path(__file__).parent / "results"


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    parser.add_argument("data", type=Path, help="folder laid out as CLASS/{train,test}/*.obj")
    parser.add_argument("--out", type=Path, default=Path("runs"), help="folder for the runs")
    parser.add_argument("--seeds", type=int, nargs="+", default=[0, 1, 2])
    # The order of additions, and with it the last digits of the weights, follows the threads: the
    # shipped weights were trained on one.
    parser.add_argument("--threads", default="1")
    arguments = parser.parse_args()

    rows = []
    for seed in arguments.seeds:
        folder = arguments.out / f"{arguments.data.name}-seed{seed}"
        checkpoint = folder / "model.safetensors"
        if not checkpoint.exists():
            command = ["meshconv3d", "train", str(arguments.data), "--out", str(folder)]
            command += ["--seed", str(seed), "--threads", arguments.threads]
            subprocess.run(command, check=True, stdout=sys.stderr)
        training = load_checkpoint(checkpoint).training
        epochs = [json.loads(line) for line in (folder / "log.jsonl").read_text().splitlines()]
        rows.append(
            {
                "seed": seed,
                "test_accuracy": training["accuracy"]["test"],
                "test_meshes": training["accuracy"]["test_meshes"],
                "epochs": len(epochs),
                "train_minutes": round(sum(record["seconds"] for record in epochs) / 60, 1),
            }
        )
    accuracies = [row["test_accuracy"] for row in rows]
    summary = {
        "data": arguments.data.name,
        "selection": "last epoch",
        "mean": round(statistics.mean(accuracies), 5),
        "spread": round(max(accuracies) - min(accuracies), 5),
        "runs": rows,
    }
    RESULTS.mkdir(exist_ok=True)
    path = RESULTS / f"accuracy_{arguments.data.name}.json"
    path.write_text(json.dumps(summary, indent=2) + "\n")
    print("seed  test accuracy  meshes  epochs  minutes")
    for row in rows:
        print(
            f"{row['seed']:4}  {row['test_accuracy']:13.2%}  {row['test_meshes']:6}  "
            f"{row['epochs']:6}  {row['train_minutes']:7}"
        )
    print(f"mean {summary['mean']:.2%}, spread {summary['spread']:.2%} (last epoch, no selection)")


if __name__ == "__main__":
    main()
