"""One mesh of 500 faces on one core: `python -m benchmarks run latency`.

The time of every stage from the bytes of a file to scores, that of the whole, and onnxruntime
beside torch on the same graph.
"""

import torch

from benchmarks import peers
from benchmarks.figures import MILLISECONDS, Findings, heading
from benchmarks.measuring import best, yardstick
from benchmarks.stages import Stages
from benchmarks.workloads import as_file, sample
from meshconv3d.model.nn.network import Network, as_tensors
from meshconv3d.model.preparation import prepare
from meshconv3d.service.classifier import Classifier
from meshconv3d.service.models import open_model

FORMATS = ("stl", "ply", "glb")
# Milliseconds to read a binary file of 500 faces and to prepare it.
READ_AND_PREPARE = 2.0
# Of the time from arrays to scores, what topology and descriptors may take.
INDEX_SHARE = 0.1
# Yardsticks from arrays to scores.
ARRAYS_TO_SCORES = 0.12


def run(model_name: str) -> Findings:
    """Measure and print; the model by name or file."""
    model = open_model(model_name)
    mesh, config = sample(), model.card.config
    stages = Stages(mesh, prepare(mesh, config.face_budget)[0], config, model)
    network = Network(config).eval()
    tensors = as_tensors(stages.arrays)
    classifier = Classifier(model)
    content = as_file(mesh, "stl")

    def eager() -> None:
        with torch.inference_mode():
            network(*tensors)

    def in_memory() -> None:
        classifier.classify(mesh)

    times = best(
        {
            "yardstick": yardstick(),
            **{f"read {extension}": stages.reader(extension) for extension in FORMATS},
            "prepare": stages.prepare,
            "topology": stages.topology,
            "descriptors": stages.descriptors,
            "topology, descriptors, collation": stages.inputs,
            "graph": stages.graph,
            "arrays to scores": stages.scores,
            "arrays as found to scores": in_memory,
            "bytes of an STL to scores": lambda: classifier.classify(content, "stl"),
            "torch eager": eager,
        }
    )
    findings = Findings(times.pop("yardstick"))
    heading(f"One mesh of {len(mesh.faces)} faces, one thread; {model.card.name}")
    for name, elapsed in times.items():
        findings.add(name, elapsed, MILLISECONDS)
    for extension in FORMATS:
        together = times[f"read {extension}"] + times["prepare"]
        findings.add(f"read {extension} and prepare", together, MILLISECONDS, READ_AND_PREPARE)
    share = times["topology, descriptors, collation"] / times["arrays to scores"]
    findings.add("topology and descriptors, of the whole", share, "of 1", INDEX_SHARE)
    heading("From arrays to scores")
    findings.cost("prepared arrays to scores", times["arrays to scores"], ARRAYS_TO_SCORES)
    found = times["arrays as found to scores"]
    findings.cost("with preparation and report", found, ARRAYS_TO_SCORES)
    peers.show(times["arrays to scores"] / findings.yardstick, "arrays_to_scores")
    print(f"    of DiffusionNet the network alone         {peers.DIFFUSION_NETWORK_ALONE:>10g}")
    return findings
