"""Functions of `export.whole` as graphs, run by onnxruntime on arrays."""

from collections.abc import Callable, Sequence

import numpy as np
import onnx
from numpy.typing import DTypeLike, NDArray
from onnx import helper

from meshconv3d.export.runtime import open_session
from meshconv3d.export.whole.arrays import Array, Graph


class Written:
    """A function of Arrays of these types; called with arrays, it gives all that it returns."""

    def __init__(self, function: Callable[..., Sequence[Array]], *dtypes: DTypeLike) -> None:
        inputs = [Array(f"input_{i}", dtype) for i, dtype in enumerate(dtypes)]
        with Graph() as graph:
            outputs = function(*inputs)
        self.names = [array.name for array in inputs]
        self.dtypes = [array.dtype for array in inputs]
        values = [
            helper.make_tensor_value_info(
                array.name, helper.np_dtype_to_tensor_dtype(array.dtype), None
            )
            for array in (*inputs, *outputs)
        ]
        proto = graph.to_proto("written", values[: len(inputs)], values[len(inputs) :])
        model = helper.make_model(proto, ir_version=10, opset_imports=[helper.make_opsetid("", 20)])
        assert isinstance(model, onnx.ModelProto)
        self.session = open_session(model.SerializeToString())

    def __call__(self, *arrays: NDArray | int) -> list[NDArray]:
        feeds = {
            name: np.asarray(array, dtype)
            for name, array, dtype in zip(self.names, arrays, self.dtypes, strict=True)
        }
        return [np.asarray(output) for output in self.session.run(None, feeds)]
