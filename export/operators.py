"""Our operators under onnxruntime, for graphs with learned pooling.

Such a graph calls the topology stage between its layers by two operators, GrowPatches and
PoolFaces, with the inputs, outputs and attributes of `model.topology.batch`. Its functions are
the kernels here, called through onnxruntime-extensions; another runtime can supply its own. The
extension is loaded only for a file that needs it.
"""

import functools
from types import ModuleType

from meshconv3d.export.metadata import ModelFileError

# The one domain under which onnxruntime-extensions takes operators written in Python.
DOMAIN = "ai.onnx.contrib"
VERSION = 1


def operator_library() -> str:
    """The library to register with a session. Raises ModelFileError where there is none."""
    return _extension().get_library_path()


@functools.cache
def _extension() -> ModuleType:
    """onnxruntime-extensions, with our kernels registered once in a process."""
    try:
        import onnxruntime_extensions as extension
    except ImportError:
        raise ModelFileError(
            "learned pooling needs onnxruntime-extensions, which comes with an extra: "
            "pip install 'meshconv3d[learned]'"
        ) from None
    # An exception in a kernel would end the process. These raise none: the topology stage takes
    # any surface, and its inputs come from our own code.
    from meshconv3d.model.topology import batch as kernels

    kind = extension.PyCustomOpDef
    real, whole, precise = kind.dt_float, kind.dt_int32, kind.dt_double
    extension.onnx_op(
        op_type="GrowPatches",
        inputs=[whole, precise],
        outputs=[whole],
        attrs={"patch_size": kind.dt_int64},
    )(kernels.grow_patches)
    extension.onnx_op(
        op_type="PoolFaces",
        inputs=[real, whole, precise, whole],
        outputs=[whole, real, whole, precise, whole],
        attrs=dict.fromkeys(("target", "squared_norm", "literal"), kind.dt_int64),
    )(kernels.pool_faces)
    return extension
