"""Floating-point operations and bytes of the nodes of a graph, as onnxruntime runs it.

onnxruntime's profiler gives every node that it runs, after its own fusions, with the shapes of a
real run. What a node costs at least follows from these.
"""

import json
import math
import tempfile
from collections import defaultdict
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from numpy.typing import NDArray

from benchmarks.stages import OUTPUTS
from meshconv3d.export.runtime import onnxruntime, session_options

PRODUCTS = frozenset({"Gemm", "FusedGemm", "MatMul", "FusedMatMul"})
# They move numbers and compute none.
MOVES = frozenset({"Cast", "Concat", "Expand", "Gather", "Slice", "Split", "Transpose"})
# They say of the same bytes that they have another shape.
VIEWS = frozenset({"Reshape", "Shape", "Squeeze", "Unsqueeze", "Identity"})
SIZES = {"double": 8, "int64": 8, "int32": 4, "float": 4, "float16": 2, "int8": 1, "bool": 1}
RUNS = 50

Shape = tuple[int, ...]
Shapes = list[tuple[str, Shape]]  # with the type of the numbers


@dataclass(frozen=True)
class NodeCost:
    """One node. milliseconds: its least time; operations and bytes: the least it needs."""

    name: str
    kind: str
    shapes: str
    operations: int
    bytes: int
    milliseconds: float

    @property
    def is_product(self) -> bool:
        return self.kind in PRODUCTS


def profile_nodes(content: bytes, arrays: Mapping[str, NDArray]) -> list[NodeCost]:
    """The nodes of a model file, in the order in which they run."""
    with tempfile.TemporaryDirectory() as folder:
        options = session_options()
        options.enable_profiling = True
        options.profile_file_prefix = str(Path(folder) / "profile")
        session = onnxruntime.InferenceSession(content, options)
        for _ in range(RUNS):
            session.run(OUTPUTS, dict(arrays))
        events = json.loads(Path(session.end_profiling()).read_text())
    times: dict[str, list[float]] = defaultdict(list)
    arguments: dict[str, dict[str, Any]] = {}
    for event in events:
        if event["cat"] == "Node" and event["name"].endswith("_kernel_time"):
            times[event["name"]].append(event["dur"] / 1000)
            arguments[event["name"]] = event["args"]
    return [_node(name, arguments[name], min(times[name])) for name in arguments]


def product_sides(node: NodeCost) -> tuple[int, int, int]:
    """Rows, inner dimension and columns of a product."""
    rows, inner, columns = map(int, node.shapes.split(" x "))
    return rows, inner, columns


def _node(name: str, arguments: dict[str, Any], milliseconds: float) -> NodeCost:
    kind = arguments["op_name"]
    inputs, outputs = (_shapes(arguments[f"{side}_type_shape"]) for side in ("input", "output"))
    operations, moved = cost(kind, inputs, outputs)
    if kind in PRODUCTS:
        sides = (*_product(inputs, outputs),)
        shapes = " x ".join(map(str, sides))
    else:
        shapes = " ".join(str(list(shape)) for _, shape in outputs)
    return NodeCost(
        name.removesuffix("_kernel_time"), kind, shapes, operations, moved, milliseconds
    )


def cost(kind: str, inputs: Shapes, outputs: Shapes) -> tuple[int, int]:
    """Operations and bytes of a node: every input read once, every output written once.

    Of the table that a Gather reads, no more than it gives. The weights of a product are no
    input any more once onnxruntime has packed them; their shape follows from the others.
    """
    if kind in VIEWS:
        return 0, 0
    written = sum(map(_bytes, outputs))
    if kind in PRODUCTS:
        rows, inner, columns = _product(inputs, outputs)
        size = SIZES[outputs[0][0]]
        return 2 * rows * inner * columns, size * (rows * inner + inner * columns + rows * columns)
    if kind == "Gather":
        return 0, min(_bytes(inputs[0]), written) + sum(map(_bytes, inputs[1:])) + written
    read = sum(map(_bytes, inputs))
    if kind in MOVES:
        return 0, read + written
    # An element of the larger side is one operation: a sum is read, a broadcast is written.
    largest = max(math.prod(shape) for _, shape in (*inputs, *outputs))
    return largest, read + written


def _product(inputs: Shapes, outputs: Shapes) -> tuple[int, int, int]:
    inner, columns = inputs[0][1][-1], outputs[0][1][-1]
    return math.prod(outputs[0][1][:-1]), inner, columns


def _bytes(tensor: tuple[str, Shape]) -> int:
    kind, shape = tensor
    return SIZES[kind] * math.prod(shape)


def _shapes(listed: list[dict[str, list[int]]]) -> Shapes:
    return [(kind, tuple(shape)) for entry in listed for kind, shape in entry.items()]
