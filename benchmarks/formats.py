"""Costs of reading every format: `python -m benchmarks run formats`.

A mesh of 200,000 faces in each, from bytes to a mesh, in milliseconds of the processor for each
megabyte; then a million faces as OBJ, from bytes to scores. Processes that read for a format are
counted. Each format has a process of its own.
"""

import resource
import time
from collections.abc import Callable

from benchmarks.figures import Findings, heading
from benchmarks.measuring import apart, best, yardstick
from benchmarks.workloads import FORMS, as_file, torus
from meshconv3d.model.loading import load_mesh
from meshconv3d.service.classifier import Classifier

FACES, MILLION = 200_000, 1_000_000
TURNS = 5
# Milliseconds for each MB, where there is a goal: 150 MB/s, and 100.
GOALS = {"obj": 6.67, "off": 6.67, "text stl": 10.0, "text ply": 10.0}
MILLION_SECONDS = 2.5


def run(model_name: str) -> Findings:
    """Measure and print; the model by name or file."""
    findings = Findings(best({"yardstick": yardstick()})["yardstick"])
    heading(f"{FACES:,} faces, from bytes to a mesh")
    for form in FORMS:
        findings.add(f"read {form}", apart(read_cost, form), "ms/MB", GOALS.get(form))
    heading(f"{MILLION:,} faces as OBJ, from bytes to scores")
    seconds = apart(classify_million, model_name)
    findings.add("a million faces as OBJ", seconds, "s", MILLION_SECONDS)
    return findings


def read_cost(form: str) -> float:
    """Milliseconds to read a MB of a file."""
    content = as_file(torus(FACES), form)
    extension = form.split()[-1]
    load_mesh(as_file(torus(500), form), extension)  # loads what is loaded once
    return _least(lambda: load_mesh(content, extension)) * 1000 / (len(content) / 1e6)


def classify_million(model_name: str) -> float:
    """Seconds from the bytes of a file to scores."""
    classifier = Classifier.load(model_name)
    content = as_file(torus(MILLION), "obj")
    classifier.classify(as_file(torus(5_000), "obj"), "obj")
    return _least(lambda: classifier.classify(content, "obj"))


def _least(call: Callable[[], object]) -> float:
    """Seconds of the processor, of this process and those that it began."""
    spent = []
    for _ in range(TURNS):
        before = _computed()
        call()
        spent.append(_computed() - before)
    return min(spent)


def _computed() -> float:
    children = resource.getrusage(resource.RUSAGE_CHILDREN)
    return time.process_time() + children.ru_utime + children.ru_stime
