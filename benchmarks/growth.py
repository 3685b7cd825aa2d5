"""Time and memory against the number of faces: `python -m benchmarks run growth`.

Every stage from 500 to a million faces, each size in a process of its own, and the exponent that
fits its times; that of preparation leaves out the mesh that fits the budget and is not decimated. A
size is left out where it would take more than half of the free memory. Preparation brings all sizes
to the face budget; topology, descriptors and graph work on all faces, with pooling targets in
proportion. Then a million faces in one piece, from bytes to scores.
"""

import time
from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from benchmarks.figures import Findings, heading
from benchmarks.measuring import (
    apart,
    available_memory,
    best,
    peak_memory,
    process_peak,
    yardstick,
)
from benchmarks.stages import Stages
from benchmarks.workloads import as_file, torus
from meshconv3d.service.classifier import Classifier
from meshconv3d.service.models import Model, open_model

SIZES = (500, 5_000, 50_000, 500_000, 1_000_000)
MILLION = SIZES[-1]
# Seconds and MB of a million-face GLB, from bytes to scores; of the whole process.
MILLION_SECONDS, MILLION_MEGABYTES = 10.0, 2000.0

STAGES: dict[str, Callable[[Stages], Callable[[], object]]] = {
    "read glb": lambda stages: stages.reader("glb"),
    "read stl": lambda stages: stages.reader("stl"),
    "prepare": lambda stages: stages.prepare,
    "topology": lambda stages: stages.topology,
    "descriptors": lambda stages: stages.descriptors,
    "graph": lambda stages: stages.graph,
}


def run(model_name: str) -> Findings:
    """Measure and print; the model by name or file."""
    findings = Findings(best({"yardstick": yardstick()})["yardstick"])
    heading(f"{'Stage':14}{'faces':>12}{'ms':>12}{'us/face':>10}{'MB':>10}")
    for name in STAGES:
        findings.tables[name] = points = _grow(name, model_name)
        # A mesh that fits the budget is not decimated: a step, no growth.
        fitted = points[1:] if name == "prepare" else points
        faces = [point["faces"] for point in fitted]
        power = exponent(faces, [point["ms"] for point in fitted])
        most = exponent(faces, [count * np.log(count) for count in faces])
        findings.add(f"{name}: time as faces to the power", power, "", round(most, 3))
    heading(f"{MILLION:,} faces as GLB, from bytes to scores")
    million = apart(classify_million, model_name)
    findings.add("a million faces", million["seconds"], "s", MILLION_SECONDS)
    findings.add("a million faces, memory", million["megabytes"], "MB", MILLION_MEGABYTES)
    return findings


def _grow(stage: str, model_name: str) -> list[dict[str, float]]:
    """A stage at every size that the machine has memory for."""
    points: list[dict[str, float]] = []
    for size in SIZES:
        expected = points[-1]["MB"] * size / points[-1]["faces"] if points else 0.0
        if expected > available_memory() / 2:
            print(f"  {stage:12}{size:>12,} left out: about {expected / 1000:.0f} GB")
            break
        points.append(point := apart(measure, stage, size, model_name))
        each = point["ms"] / point["faces"] * 1000
        print(f"  {stage:12}{point['faces']:>12,.0f}{point['ms']:>12.3f}", end="")
        print(f"{each:>10.3f}{point['MB']:>10.1f}", flush=True)
    return points


def measure(stage: str, size: int, model_name: str) -> dict[str, float]:
    """One stage at one size, in this process: milliseconds, and MB above what it is given."""
    model = open_model(model_name)
    call = STAGES[stage]
    call(_stages(SIZES[0], model))()  # loads what is loaded once
    stages = _stages(size, model)
    work = call(stages)
    if stage == "graph":
        _ = stages.arrays  # they are given, too
    with peak_memory() as peak:
        work()
    milliseconds = best({"": work})[""]
    return {"faces": len(stages.mesh.faces), "ms": milliseconds, "MB": peak.megabytes}


def _stages(size: int, model: Model) -> Stages:
    mesh, config = torus(size), model.card.config
    share = len(mesh.faces) / config.face_budget
    targets = tuple(int(target * share) for target in config.targets)
    return Stages(mesh, mesh, replace(config, targets=targets), model)


def exponent(sizes: Sequence[float], costs: Sequence[float]) -> float:
    """The power of the size with which costs grow: the line that fits their logarithms."""
    return float(np.polyfit(np.log(sizes), np.log(costs), 1)[0])


def classify_million(model_name: str) -> dict[str, float]:
    """Seconds of the clock from the bytes of a file to scores, and MB of this whole process."""
    classifier = Classifier.load(model_name)
    content = apart(glb, MILLION)  # what making it takes is not this process's
    classifier.classify(glb(SIZES[1]), "glb")  # loads what is loaded once
    started = time.perf_counter()
    classifier.classify(content, "glb")
    return {"seconds": time.perf_counter() - started, "megabytes": process_peak()}


def glb(faces: int) -> bytes:
    return as_file(torus(faces), "glb")
