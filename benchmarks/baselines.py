"""Baselines on the same files: `python -m benchmarks.baselines DATA --model MODEL`.

Three methods that know nothing of mesh convolution, on the split and the prepared meshes of the
network: nearest neighbour by spectrum, boosted trees over shape descriptors, and a small network
over sampled points. None of their settings was chosen on test meshes. Prints a table, with the
models named beside them, and keeps every run as JSON in benchmarks/results/; a run that is there
already is only read.
"""

import argparse
import hashlib
import json
import statistics
import time
from dataclasses import asdict
from functools import cached_property
from pathlib import Path
from typing import Any

from benchmarks.baseline_methods.data import Part, read_part
from benchmarks.baseline_methods.descriptors import Descriptors
from benchmarks.baseline_methods.points import Points
from benchmarks.baseline_methods.spectrum import Spectrum
from benchmarks.scores import figures
from meshconv3d.model.datasets import Sample, class_names, find_samples
from meshconv3d.service.classifier import Classifier
from meshconv3d.service.evaluation import DataId, classify_samples, summarise

RESULTS = Path(__file__).parent / "results"


class Data:
    """A data set whose files are read at first use."""

    def __init__(self, samples: list[Sample], root: Path) -> None:
        self.samples = samples
        self.root = root
        self.classes = class_names(samples)
        lines = [f"{s.path.relative_to(root).as_posix()} {s.label} {s.split}" for s in samples]
        self.split_sha256 = hashlib.sha256("\n".join(lines).encode()).hexdigest()

    @cached_property
    def train(self) -> Part:
        return self._part("train")

    @cached_property
    def test(self) -> Part:
        return self._part("test")

    def _part(self, split: str) -> Part:
        return read_part([s for s in self.samples if s.split == split], self.classes)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    parser.add_argument("data", type=Path, help="folder laid out as CLASS/{train,test}/*")
    parser.add_argument("--split", type=Path, help="CSV with the columns class,file,split")
    parser.add_argument("--seeds", type=int, nargs="+", default=[0, 1, 2])
    parser.add_argument("--epochs", type=int, default=Points.epochs, help="of the point network")
    parser.add_argument("--model", action="append", default=[], help="of ours: name or file")
    arguments = parser.parse_args()

    data = Data(find_samples(arguments.data, arguments.split), arguments.data)
    path = RESULTS / f"baselines_{arguments.data.name}.json"
    methods = {
        # Nothing in it is random.
        "spectrum": (Spectrum(), [0]),
        "descriptors": (Descriptors(), arguments.seeds),
        "points": (Points(epochs=arguments.epochs), arguments.seeds),
    }
    print("method       top-1   top-5  balanced  spread  seeds  minutes")
    for name, (method, seeds) in methods.items():
        runs = [run_once(name, method, seed, data, path) for seed in seeds]
        print(table_row(name, runs), flush=True)
    for model in arguments.model:
        print(model_row(model, data), flush=True)


def run_once(
    name: str, method: Spectrum | Descriptors | Points, seed: int, data: Data, path: Path
) -> dict[str, Any]:
    """The record of one run, read from the file or run and added to it."""
    identity = {"method": name, "settings": asdict(method), "seed": seed}
    records = read_records(path, data.split_sha256)
    for record in records:
        if identity.items() <= record.items():
            return record
    train, test = data.train, data.test
    # Processor time, of all threads: whatever else the machine does is not counted.
    started = time.process_time()
    scores = method.scores(train, test, seed)
    minutes = round((time.process_time() - started) / 60, 2)
    result = figures(scores, test.labels, test.refused)
    record = identity | {key: round(value, 5) for key, value in result.items()}
    record["minutes"] = minutes
    write_records(path, data, [*records, record])
    return record


def read_records(path: Path, split_sha256: str) -> list[dict[str, Any]]:
    """The runs kept for this split; those of another split are dropped."""
    if not path.exists():
        return []
    kept = json.loads(path.read_text())
    return kept["runs"] if kept["split_sha256"] == split_sha256 else []


def write_records(path: Path, data: Data, records: list[dict[str, Any]]) -> None:
    summary = {
        "data": path.stem.removeprefix("baselines_"),
        "split_sha256": data.split_sha256,
        "classes": len(data.classes),
        "train_meshes": len(data.train.meshes),
        "train_refused": len(data.train.refused),
        "test_meshes": len(data.test.meshes),
        "test_refused": len(data.test.refused),
        "runs": records,
    }
    path.parent.mkdir(exist_ok=True)
    path.write_text(json.dumps(summary, indent=2) + "\n")


def model_row(name: str, data: Data) -> str:
    """The row of one of our models, on the test files."""
    classifier = Classifier.load(name)
    started = time.process_time()
    samples = [sample for sample in data.samples if sample.split == "test"]
    outcomes = list(classify_samples(classifier, samples))
    identity = DataId(folder=data.root.name, split_file=None, part="test")
    report = summarise(classifier.model, identity, outcomes, time.process_time() - started)
    return (
        f"{report.model.name:11}  {report.accuracy:6.2%} {report.top5_accuracy:7.2%}  "
        f"{report.balanced_accuracy:8.2%}"
    )


def table_row(name: str, runs: list[dict[str, Any]]) -> str:
    """Means over the runs and the spread of their top-1 accuracy."""
    means = {
        key: statistics.mean(run[key] for run in runs)
        for key in ("top1", "top5", "balanced", "minutes")
    }
    top1 = [run["top1"] for run in runs]
    return (
        f"{name:11}  {means['top1']:6.2%} {means['top5']:7.2%}  {means['balanced']:8.2%}  "
        f"{max(top1) - min(top1):6.2%}  {len(runs):5}  {means['minutes']:7.1f}"
    )


if __name__ == "__main__":
    main()
