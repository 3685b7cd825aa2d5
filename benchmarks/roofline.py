"""Time of every stage and of its floor: `python -m benchmarks run roofline`.

The floor of a node of the graph is the longer of its operations at this machine's rate for matrix
products and its bytes at the rate at which this machine copies from cache to cache; both rates are
measured in the same run. A stage outside the graph has the floor of its bytes: what it reads and
what it leaves, each once.
"""

from collections import defaultdict
from collections.abc import Sequence

import numpy as np
import torch

from benchmarks.figures import MILLISECONDS, Findings, heading
from benchmarks.measuring import YARDSTICK_SIDE, best, yardstick
from benchmarks.node_costs import NodeCost, product_sides, profile_nodes
from benchmarks.stages import Stages
from benchmarks.workloads import as_file, sample
from meshconv3d.model.mesh import Mesh
from meshconv3d.model.preparation import prepare
from meshconv3d.service.models import ModelFile

CACHED = 2**19  # bytes that a core keeps close, as it does the tensors of one mesh
UNCACHED = 2**28
# How many times its own matrix products the graph may take.
GRAPH = 1.3


def run(model_name: str) -> Findings:
    """Measure and print; the model by name or file."""
    file = ModelFile.read(model_name)
    model = file.open()
    mesh, config = sample(), model.card.config
    stages = Stages(mesh, prepare(mesh, config.face_budget)[0], config, model)
    content = as_file(mesh, "stl")
    nodes = profile_nodes(file.content, stages.arrays)
    calls = {
        "read": stages.reader("stl"),
        "prepare": stages.prepare,
        "topology": stages.topology,
        "descriptors": stages.descriptors,
        "graph": stages.graph,
    }
    times = best(
        {
            "yardstick": yardstick(),
            "cached copy": _copy(CACHED),
            "copy": _copy(UNCACHED),
            **calls,
            **{node.name: _product(node) for node in nodes if node.is_product},
        },
        seconds=0.5,
    )
    findings = Findings(times["yardstick"])
    rate = 2 * YARDSTICK_SIDE**3 / times["yardstick"] * 1000
    bandwidth = 2 * CACHED / times["cached copy"] * 1000
    heading("This machine, one thread")
    print(
        f"  matrix products {rate / 1e9:.1f} GFLOP/s; copies {bandwidth / 1e9:.1f} GB/s in cache, "
    )
    print(
        f"  {2 * UNCACHED / times['copy'] / 1e6:.1f} GB/s in memory; read and written both counted"
    )

    floors = {node.name: _floor(node, rate, bandwidth) for node in nodes}
    moved = {
        "read": len(content) + _size(mesh),
        "prepare": _size(mesh) + _size(stages.prepared),
        "topology": _size(stages.prepared)
        + sum(array.nbytes for name, array in stages.arrays.items() if name != "terms"),
        "descriptors": _size(stages.prepared) + stages.arrays["terms"].nbytes,
    }
    stage_floors = {name: bytes_ / bandwidth * 1000 for name, bytes_ in moved.items()}
    stage_floors["graph"] = sum(floors.values())
    _show_stages(findings, stage_floors, times)
    _show_graph(findings, nodes, floors, times)
    return findings


def _show_stages(findings: Findings, floors: dict[str, float], times: dict[str, float]) -> None:
    heading(f"{'Stage of one mesh, ms':36}     floor   measured      ratio")
    for name, floor in floors.items():
        print(f"  {name:34}{floor:>10.4f}{times[name]:>11.4f}{times[name] / floor:>11.1f}")
    findings.tables["stages"] = {
        name: {"floor": floor, "measured": times[name]} for name, floor in floors.items()
    }


def _show_graph(
    findings: Findings,
    nodes: Sequence[NodeCost],
    floors: dict[str, float],
    times: dict[str, float],
) -> None:
    heading(f"{'Node of the graph, ms':56}     floor   measured      ratio")
    for node in nodes:
        title = f"{node.kind:12} {node.shapes[:40]}"
        print(f"  {title:54}{floors[node.name]:>10.4f}{node.milliseconds:>11.4f}", end="")
        print(f"{node.milliseconds / floors[node.name]:>11.1f}" if floors[node.name] else "")
    kinds: dict[str, float] = defaultdict(float)
    for node in nodes:
        kinds[node.kind] += node.milliseconds
    heading("Time of the graph by kind of node, ms")
    for kind, milliseconds in sorted(kinds.items(), key=lambda item: -item[1]):
        print(f"  {kind:34}{milliseconds:>10.4f}")
    products = [node for node in nodes if node.is_product]
    # By the better of two libraries, each product by itself.
    alone = sum(min(times[node.name], node.milliseconds) for node in products)
    heading("The graph beside its own matrix products")
    findings.add("graph", times["graph"], MILLISECONDS)
    findings.add("its matrix products", alone, MILLISECONDS)
    findings.add("graph over its matrix products", times["graph"] / alone, "times", GRAPH)
    findings.tables["nodes"] = [
        {
            "name": node.name,
            "kind": node.kind,
            "shapes": node.shapes,
            "operations": node.operations,
            "bytes": node.bytes,
            "floor": floors[node.name],
            "measured": node.milliseconds,
        }
        for node in nodes
    ]


def _floor(node: NodeCost, rate: float, bandwidth: float) -> float:
    """Milliseconds."""
    return max(node.operations / rate, node.bytes / bandwidth) * 1000


def _copy(size: int):
    source, target = np.ones(size, np.uint8), np.empty(size, np.uint8)
    return lambda: np.copyto(target, source)


def _product(node: NodeCost):
    """The product of a node by itself, of other numbers."""
    rows, inner, columns = product_sides(node)
    a, b = torch.rand(rows, inner), torch.rand(inner, columns)
    out = torch.empty(rows, columns)
    return lambda: torch.mm(a, b, out=out)


def _size(mesh: Mesh) -> int:
    return mesh.vertices.nbytes + mesh.faces.nbytes
