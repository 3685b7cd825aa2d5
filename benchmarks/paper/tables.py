"""The paper's tables as Markdown, its figures beside ours: `docs/paper.md` has them as they are.

A figure that is not there yet reads "not run"; nothing is printed that no run gave.
"""

import json
import statistics
from collections.abc import Iterable, Sequence
from typing import Any

from benchmarks.paper import cost
from benchmarks.paper.accuracy import PROTOCOLS, Protocol, Results, read_results
from benchmarks.peers import MEASURED_ELSEWHERE
from benchmarks.suite import ROOT, Run

RESULTS = ROOT / "benchmarks" / "results"

# Accuracy in per cent by method, as published, by the protocol's title.
METHODS = ("MeshCNN", "SubdivNet", "ExMeshCNN", "MeshConv3D")
PUBLISHED: dict[str, tuple[str, ...]] = {
    "SHREC11, split 16": ("98.6", "100", "100", "100"),
    "SHREC11, split 10": ("91.0", "100", "100", "100"),
    "cubes, random split": ("92.2", "100", "100", "100"),
    "Manifold40": ("-", "91.4", "93.6", "92.4"),
}
# Run time as a ratio, and peak memory in MB.
PUBLISHED_COST = {
    "MeshConv3D": ("1", "682"),
    "MeshCNN": ("1.40", "2596"),
    "MeshNet++": ("3.81", "7440"),
    "SubdivNet": ("0.87", "6981"),
}
MODELNET40_TRAIN = 9843  # meshes, of Manifold40, too
# Of `benchmarks.corruptions`.
CHANGES = (
    "unchanged",
    "rotated at random",
    "a floor plate",
    "two Loop subdivisions",
    "250 faces",
    "flattest 30 % of edges flipped",
    "isotropic remeshing",
    "marching cubes",
    "noise, 0.5 % of the diagonal",
    "noise, 1 % of the diagonal",
    "10 % of the faces cut out",
    "20 % of the faces in five holes",
)
NOTHING = "-"


def all_tables() -> list[str]:
    """Tables I to III from the results that are kept, that of changed meshes, and the summary."""
    results = read_results()
    quiet = Run.read(RESULTS / "performance.json").findings["training_step"]
    changed = {
        network: json.loads((RESULTS / f"robustness_{network}.json").read_text())["accuracy"]
        for network in ("paper", "default")
    }
    step = quiet.figures["ours, in yardsticks"].value
    found = cost.read()
    return [
        table_1(results),
        table_2(results),
        table_3(found, step),
        changes(changed),
        summary(results, found),
    ]


def table_1(results: Results) -> str:
    """Accuracy on SHREC11 and on cubes."""
    header = ["test accuracy, %", *METHODS, "`paper` here", "ours here"]
    return _table(
        header, (_row(p, results) for name in ("shrec11", "cubes") for p in PROTOCOLS[name])
    )


def table_2(results: Results) -> str:
    """Accuracy on Manifold40 and ModelNet40, and how long a run takes."""
    header = ["test accuracy, %", *METHODS, "here", "hours for a run of `paper`, of `default`"]
    rows = []
    for protocol in (*PROTOCOLS["manifold40"], *PROTOCOLS["modelnet40"]):
        hours = [_hours(protocol, network, results) for network in protocol.networks]
        published = PUBLISHED.get(protocol.title, (NOTHING,) * len(METHODS))
        rows.append([protocol.title, *published, "data not to be had", ", ".join(hours)])
    return _table(header, rows)


def table_3(found: dict[str, Any], default: float) -> str:
    """Run time and peak memory; run times are relative to the preset `paper`.

    default: yardsticks of a step of the preset `default` on a machine that does nothing else, to
    which those of other methods are related.
    """
    header = ["50 batches of 50 meshes", "time, paper", "MB, paper", "time here", "MB here"]
    ratio = {
        title: own / found["yardsticks"]["paper"] for title, own in found["yardsticks"].items()
    }
    here = {title: (f"{ratio[title]:.2f}", f"{found['megabytes'][title]:.0f}") for title in ratio}
    theirs = {
        name: (f"{peer.training_step / default * ratio['default']:.2f}", NOTHING)
        for name, peer in MEASURED_ELSEWHERE.items()
    }
    ours = ["MeshConv3D", *PUBLISHED_COST["MeshConv3D"], *here["paper"]]
    rows = [ours]
    rows += [[f"our {t}", NOTHING, NOTHING, *here[t]] for t in here if t != "paper"]
    for name in {**PUBLISHED_COST, **theirs}:
        if name != "MeshConv3D":
            nothing = (NOTHING, NOTHING)
            rows.append([name, *PUBLISHED_COST.get(name, nothing), *theirs.get(name, nothing)])
    return _table(header, rows)


def summary(results: Results, found: dict[str, Any]) -> str:
    """The paper's own figures beside ours, for the README."""
    header = ["", "paper", "`paper` here", "ours here", "`python -m benchmarks.paper`"]
    rows = [
        [f"{title}, %", published, *here, f"`{name} DATA`"]
        for name in ("shrec11", "cubes")
        for title, _, _, _, published, *here in (_row(p, results) for p in PROTOCOLS[name])
    ]
    published = PUBLISHED["Manifold40"][-1]
    rows.append(["Manifold40, %", published, *["data not to be had"] * 2, "`manifold40 DATA`"])
    times, memory = found["yardsticks"], found["megabytes"]
    time = f"{times['default'] / times['paper']:.2f}"
    megabytes = (f"{memory[network]:.0f}" for network in ("paper", "default"))
    rows.append(["time of a training step, relative", "1", "1", time, "`cost DATA`"])
    published = PUBLISHED_COST["MeshConv3D"][-1]
    rows.append(["its peak memory, MB", published, *megabytes, "`cost DATA`"])
    return _table(header, rows)


def changes(accuracy: dict[str, dict[str, float]]) -> str:
    """Accuracy by network on changed test meshes, of `benchmarks.robustness`."""
    header = ["test accuracy, %", *(f"`{network}`" for network in accuracy)]
    rows = [
        [title, *(f"{100 * shares[title]:.1f}" for shares in accuracy.values())]
        for title in CHANGES
    ]
    return _table(header, rows)


def _row(protocol: Protocol, results: Results) -> list[str]:
    published = PUBLISHED.get(protocol.title, (NOTHING,) * len(METHODS))
    done = results.get(protocol.title, {})
    return [protocol.title, *published, *(_accuracy(done.get(n, {})) for n in protocol.networks)]


def _accuracy(runs: dict[str, dict[str, Any]]) -> str:
    """Mean over the seeds, with their number, the lowest and the highest."""
    if not runs:
        return "not run"
    found = [100 * run["test"] for run in runs.values()]
    mean, low, high = (f"{value:.2f}" for value in (statistics.mean(found), min(found), max(found)))
    number = "1 seed" if len(found) == 1 else f"{len(found)} seeds"
    return f"{mean} ({number})" if low == high else f"{mean} ({number}, {low} to {high})"


def _hours(protocol: Protocol, network: str, results: Results) -> str:
    """How long training takes, from the time that a mesh took on SHREC11."""
    runs = [
        run
        for known in PROTOCOLS["shrec11"]
        for run in results.get(known.title, {}).get(network, {}).values()
    ]
    if not runs:
        return "not run"
    # The least is what other work on the machine disturbed least.
    each = min(run["minutes"] / (run["epochs"] * run["train_meshes"]) for run in runs)
    return f"{each * protocol.networks[network].epochs * MODELNET40_TRAIN / 60:.1f}"


def _table(header: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    lines = [header, ["---"] * len(header), *rows]
    return "\n".join(f"| {' | '.join(line)} |" for line in lines)
