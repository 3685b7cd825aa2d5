"""Simplification beside fast-simplification: `python -m benchmarks run decimation`."""

import fast_simplification

from benchmarks.figures import MILLISECONDS, Findings, heading
from benchmarks.measuring import best, yardstick
from benchmarks.workloads import torus
from meshconv3d.model.preparation.simplification import coarsen, decimate
from meshconv3d.service.models import open_model

FACES = 100_000
# How many times the time of fast-simplification ours may take.
OF_FAST = 1.3


def run(model_name: str) -> Findings:
    """Measure and print, to the face budget of a model by name or file."""
    budget = open_model(model_name).card.config.face_budget
    mesh = torus(FACES)
    # fast-simplification takes no array that may only be read.
    vertices, faces = mesh.vertices.copy(), mesh.faces.copy()
    times = best(
        {
            "yardstick": yardstick(),
            "ours": lambda: decimate(*coarsen(vertices, faces, budget), budget),
            "the careful stage alone": lambda: decimate(vertices, faces, budget),
            "fast-simplification": lambda: fast_simplification.simplify(
                vertices, faces, target_count=budget
            ),
        }
    )
    findings = Findings(times["yardstick"])
    heading(f"{len(faces):,} faces to {budget}, one thread")
    findings.add("ours", times["ours"], MILLISECONDS)
    careful = times["the careful stage alone"]
    findings.add("the careful stage alone", careful, MILLISECONDS)
    findings.add("fast-simplification", times["fast-simplification"], MILLISECONDS)
    ratio = times["ours"] / times["fast-simplification"]
    findings.add("ours over fast-simplification", ratio, "times", OF_FAST)
    return findings
