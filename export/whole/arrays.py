"""Writing an ONNX graph as array expressions, with the names of NumPy's functions.

Within `with Graph() as graph:`, every expression of Arrays adds its nodes to the graph. All
operators are of ONNX's standard domain. Integers are int64, as indices are in ONNX; a number in an
expression takes the type of the Array beside it.
"""

from collections.abc import Callable, Sequence
from contextvars import ContextVar
from itertools import count
from typing import Any, Self

import numpy as np
import onnx
from numpy.typing import ArrayLike, DTypeLike
from onnx import helper, numpy_helper

BOOL, INT, REAL, DOUBLE = map(np.dtype, (np.bool_, np.int64, np.float32, np.float64))

_current: ContextVar["Graph"] = ContextVar("graph")


class Array:
    """A tensor of the graph: its name, and the type of its elements."""

    def __init__(self, name: str, dtype: DTypeLike) -> None:
        self.name = name
        self.dtype = np.dtype(dtype)

    def __add__(self, other: "Operand") -> "Array":
        return _binary("Add", self, other)

    def __sub__(self, other: "Operand") -> "Array":
        return _binary("Sub", self, other)

    def __rsub__(self, other: "Operand") -> "Array":
        return constant(other, self.dtype) - self

    def __mul__(self, other: "Operand") -> "Array":
        return _binary("Mul", self, other)

    def __truediv__(self, other: "Operand") -> "Array":
        return _binary("Div", self, other)

    def __rtruediv__(self, other: "Operand") -> "Array":
        return constant(other, self.dtype) / self

    def __floordiv__(self, other: "Operand") -> "Array":
        """Of integers; towards zero, where NumPy rounds down."""
        return _binary("Div", self, other)

    def __mod__(self, other: "Operand") -> "Array":
        return _binary("Mod", self, other)

    def __and__(self, other: "Array") -> "Array":
        return _binary("And", self, other)

    def __or__(self, other: "Array") -> "Array":
        return _binary("Or", self, other)

    def __invert__(self) -> "Array":
        return call("Not", self)

    def __lt__(self, other: "Operand") -> "Array":
        return _binary("Less", self, other, BOOL)

    def __le__(self, other: "Operand") -> "Array":
        return _binary("LessOrEqual", self, other, BOOL)

    def __gt__(self, other: "Operand") -> "Array":
        return _binary("Greater", self, other, BOOL)

    def __ge__(self, other: "Operand") -> "Array":
        return _binary("GreaterOrEqual", self, other, BOOL)

    def __eq__(self, other: "Operand") -> "Array":  # type: ignore[override]
        return _binary("Equal", self, other, BOOL)

    __hash__ = None  # type: ignore[assignment]

    def __getitem__(self, index: "Operand") -> "Array":
        """Rows, by an index or an array of them."""
        return take(self, index, axis=0)

    def astype(self, dtype: DTypeLike) -> "Array":
        kind = np.dtype(dtype)
        return call("Cast", self, dtype=kind, to=helper.np_dtype_to_tensor_dtype(kind))

    def reshape(self, *shape: "int | Array") -> "Array":
        """-1 is the length that is left over, 0 that which the axis has."""
        return call("Reshape", self, _joined(shape))

    def size(self, axis: int = 0) -> "Array":
        """Length of an axis, a number."""
        return call("Squeeze", call("Shape", self, dtype=INT, start=axis, end=axis + 1))


Operand = Array | ArrayLike


class Graph:
    """The nodes that are being written; `to_proto` gives them as a graph."""

    def __init__(self, prefix: str = "") -> None:
        """prefix: of the names of all values. Within another graph, this is the body of a loop."""
        outer = _current.get(None)
        self.nodes: list[onnx.NodeProto] = []
        self._prefix: str = outer._prefix if outer else prefix
        # Those of the outermost graph, which the bodies of loops see.
        self._constants: dict[tuple, onnx.TensorProto] = outer._constants if outer else {}
        self._numbers: count[int] = outer._numbers if outer else count()

    def __enter__(self) -> Self:
        self._token = _current.set(self)
        return self

    def __exit__(self, *_: object) -> None:
        _current.reset(self._token)

    def new_name(self, kind: str) -> str:
        """A name that no other value of the graph has, nor one of the bodies of its loops."""
        return f"{self._prefix}{kind}.{next(self._numbers)}"

    def name_output(self, array: Array, name: str) -> None:
        """Give an Array another name."""
        self.nodes.append(helper.make_node("Identity", [array.name], [name], name))

    def constant(self, value: np.ndarray) -> Array:
        """A tensor of this value; there is one for all that are equal."""
        key = (value.dtype.str, value.shape, value.tobytes())
        if key not in self._constants:
            self._constants[key] = numpy_helper.from_array(value, self.new_name("constant"))
        return Array(self._constants[key].name, value.dtype)

    def to_proto(
        self,
        name: str,
        inputs: Sequence[onnx.ValueInfoProto],
        outputs: Sequence[onnx.ValueInfoProto],
    ) -> onnx.GraphProto:
        """The graph with its constants."""
        return helper.make_graph(self.nodes, name, inputs, outputs, list(self._constants.values()))


def call(
    operator: str, *inputs: Array | None, dtype: DTypeLike | None = None, **attributes: Any
) -> Array:
    """Add a node of one output, whose elements have this type, or that of the first input."""
    (output,) = call_several(operator, *inputs, dtypes=[dtype], **attributes)
    return output


def call_several(
    operator: str, *inputs: Array | None, dtypes: Sequence[DTypeLike | None], **attributes: Any
) -> list[Array]:
    """Add a node of an output for each of these types; None: the type of the first input."""
    graph = _current.get()
    first = next((array.dtype for array in inputs if array), INT)
    outputs = [Array(graph.new_name(operator), dtype or first) for dtype in dtypes]
    graph.nodes.append(
        helper.make_node(
            operator,
            [array.name if array else "" for array in inputs],
            [array.name for array in outputs],
            # onnxruntime 1.20 needs names: it makes those of fused nodes of them.
            name=outputs[0].name,
            **{name: value for name, value in attributes.items() if value is not None},
        )
    )
    return outputs


def constant(value: Operand, dtype: DTypeLike = INT) -> Array:
    """The value as an Array; an Array is left as it is."""
    if isinstance(value, Array):
        return value
    return _current.get().constant(np.asarray(value, dtype))


def where(condition: Array, x: Operand, y: Operand) -> Array:
    dtype = next((array.dtype for array in (x, y) if isinstance(array, Array)), INT)
    return call("Where", condition, constant(x, dtype), constant(y, dtype), dtype=dtype)


def minimum(x: Array, y: Operand) -> Array:
    return _binary("Min", x, y)


def maximum(x: Array, y: Operand) -> Array:
    return _binary("Max", x, y)


def sqrt(x: Array) -> Array:
    return call("Sqrt", x)


def absolute(x: Array) -> Array:
    return call("Abs", x)


def ceil(x: Array) -> Array:
    return call("Ceil", x)


def floor(x: Array) -> Array:
    return call("Floor", x)


def log(x: Array) -> Array:
    return call("Log", x)


def matmul(x: Array, y: Array) -> Array:
    return call("MatMul", x, y)


def inner(x: Array, y: Array) -> Array:
    """Products of all rows of two matrices: M x C, N x C -> M x N."""
    # MatMul with a transposed matrix is fused by onnxruntime 1.20, which then lacks it in float64.
    return call("Einsum", x, y, equation="ik,jk->ij")


def outer(x: Array, y: Array) -> Array:
    """Products of all columns of two matrices: M x C, M x D -> C x D."""
    return call("Einsum", x, y, equation="ki,kj->ij")


def take(x: Array, index: Operand, axis: int) -> Array:
    """Slices of an axis, by an index or an array of them; negative ones count from the end."""
    return call("Gather", x, constant(index), axis=axis)


def take_along(x: Array, index: Array, axis: int) -> Array:
    """An element for each entry of an index that has the axes of x."""
    return call("GatherElements", x, index, axis=axis)


def crop(x: Array, start: int, stop: int | Array, axis: int = 0) -> Array:
    """The slice start:stop of an axis; `END` for all that follow."""
    bounds = [constant(start).reshape(1), constant(stop).reshape(1), constant([axis])]
    return call("Slice", x, *bounds)


END = np.iinfo(np.int64).max


def roll(x: Array, first: int, axis: int) -> Array:
    """An axis from its entry `first`, followed by those before."""
    return concatenate([crop(x, first, END, axis), crop(x, 0, first, axis)], axis)


def concatenate(arrays: Sequence[Array], axis: int) -> Array:
    return call("Concat", *arrays, axis=axis)


def stack(arrays: Sequence[Array], axis: int) -> Array:
    """Join along a new axis."""
    return concatenate([expand(array, axis) for array in arrays], axis)


def expand(x: Array, *axes: int) -> Array:
    """Insert axes of length 1, at these places of the result."""
    return call("Unsqueeze", x, constant(axes))


def broadcast(x: Array, *shape: int | Array) -> Array:
    return call("Expand", x, _joined(shape))


def full(value: Operand, dtype: DTypeLike, *shape: int | Array) -> Array:
    return broadcast(constant(value, dtype), *shape)


def arange(count: Array | int, start: int = 0) -> Array:
    """Integers from `start`, as many as `count`."""
    stop = constant(count) if start == 0 else constant(count) + start
    return call("Range", constant(start), stop, constant(1))


def sum_over(x: Array, axis: int, keepdims: bool = False) -> Array:
    """In any order: of integers, and where the last bits of a sum do not matter."""
    return call("ReduceSum", x, constant([axis]), keepdims=int(keepdims))


def sum_in_order(x: Array, axis: int) -> Array:
    """Sum from the first to the last, as the loops of kernels do: equal to the last bit."""
    return take(cumulative_sum(x, axis), -1, axis)


def cumulative_sum(x: Array, axis: int = 0) -> Array:
    return call("CumSum", x, constant(axis))


def min_over(x: Array, axis: int, keepdims: bool = False) -> Array:
    return call("ReduceMin", x, constant([axis]), keepdims=int(keepdims))


def max_over(x: Array, axis: int | None = None, keepdims: bool = False) -> Array:
    return call("ReduceMax", x, None if axis is None else constant([axis]), keepdims=int(keepdims))


def any_over(x: Array, axis: int | None = None, keepdims: bool = False) -> Array:
    """Of booleans."""
    # float32: quick everywhere.
    return max_over(x.astype(REAL), axis, keepdims) > 0


def count_over(x: Array, axis: int, keepdims: bool = False) -> Array:
    """How many booleans are true, int64."""
    return sum_over(x.astype(INT), axis, keepdims)


def argmax(x: Array, axis: int) -> Array:
    """Index of the largest along an axis, which is kept; of several, the first."""
    return call("ArgMax", x, axis=axis, keepdims=1, dtype=INT)


def sort(x: Array, length: int | Array, axis: int = 0) -> tuple[Array, Array]:
    """The `length` entries of an axis in ascending order, and their indices; equals keep theirs."""
    k = constant(length).reshape(1)
    values, order = call_several("TopK", x, k, dtypes=[None, INT], axis=axis, largest=0, sorted=1)
    return values, order


def nonzero(x: Array) -> Array:
    """Indices of the entries of a vector that are true."""
    return call("NonZero", x, dtype=INT).reshape(-1)


def scatter(x: Array, index: Array, values: Array, axis: int = 0, join: str | None = None) -> Array:
    """x with values at the indices along an axis.

    join: how a value is joined with that of x, and with others of its index: add, min or max.
    Without, no index may be there twice.
    """
    return call("ScatterElements", x, index, values, axis=axis, reduction=join)


def loop(
    going: Array, step: Callable[..., tuple[Array, ...]], state: Sequence[Array]
) -> list[Array]:
    """The state after `going, *state = step(*state)`, repeated while `going`, a boolean."""
    outer = _current.get()
    with Graph() as body:
        before = [Array(body.new_name("state"), array.dtype) for array in state]
        results = [call("Identity", array) for array in step(*before)]
    inputs = [Array(body.new_name("iteration"), INT), Array(body.new_name("going"), BOOL), *before]
    # The values of iteration and condition are numbers; the state may change its shape.
    values = [_value(array, [] if i < 2 else None) for i, array in enumerate(inputs)]
    outputs = [_value(array) for array in results]
    graph = helper.make_graph(body.nodes, outer.new_name("body"), values, outputs)
    return call_several(
        "Loop", None, going, *state, dtypes=[array.dtype for array in state], body=graph
    )


def _value(array: Array, shape: Sequence[int | str] | None = None) -> onnx.ValueInfoProto:
    kind = helper.np_dtype_to_tensor_dtype(array.dtype)
    return helper.make_tensor_value_info(array.name, kind, shape)


def _binary(operator: str, x: Array, y: Operand, dtype: DTypeLike | None = None) -> Array:
    return call(operator, x, constant(y, x.dtype), dtype=dtype)


def _joined(shape: Sequence[int | Array]) -> Array:
    lengths = [constant([x]) if isinstance(x, int) else x.reshape(1) for x in shape]
    return concatenate(lengths, 0)
