"""onnxruntime without telemetry, and sessions on model files.

Official builds of onnxruntime send events about every process, model and error, and keep an
identifier of the device in the home folder. ORT_DISABLE_TELEMETRY, which is read as the library is
loaded, is the only switch against both. All other modules import onnxruntime from this one.

A model file begins with the arrays of the topology stage; a whole-pipeline file (`export.whole`)
with the mesh. `graph_inputs` makes the inputs of either.
"""

import os
import re
from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

os.environ["ORT_DISABLE_TELEMETRY"] = "1"

import onnxruntime

from meshconv3d.export.metadata import ModelFileError
from meshconv3d.model.config import NetworkConfig
from meshconv3d.model.mesh import Mesh
from meshconv3d.model.topology.inputs import as_given, collate, mesh_inputs, whole_inputs

__all__ = ["graph_inputs", "is_whole", "onnxruntime", "open_session", "run", "session_options"]

# onnxruntime has no types for these errors: words of their messages.
OUT_OF_MEMORY = re.compile("bad_alloc|allocate memory")
NEWER = re.compile(
    "(Unsupported model IR version|Current official support for|Could not find an implementation).*"
)

# The key of an entry that names the file of a tensor's values.
EXTERNAL_DATA = b"\n\x08location\x12"


def open_session(content: bytes) -> onnxruntime.InferenceSession:
    """A session on the bytes of a model file; `run` is thread-safe.

    Raises ModelFileError for a file that is damaged, no model, without its weights, or made for a
    newer onnxruntime.
    """
    if content[8:9] == b"{" and b'"dtype"' in content[:4096]:  # safetensors
        raise ModelFileError(
            "the file is a checkpoint; make a model of it with: "
            "meshconv3d export CHECKPOINT -o MODEL.onnx"
        )
    if EXTERNAL_DATA in content:  # onnxruntime would look for it in the current folder
        raise ModelFileError(
            "its weights lie in another file, which the hash of this one does not cover; save the "
            "model with its weights in one file, as meshconv3d export does"
        )
    try:
        # Without fallback: it would print to stdout and then fail in the same way.
        session = onnxruntime.InferenceSession(
            content, session_options(), providers=["CPUExecutionProvider"], enable_fallback=0
        )
        _ = session.get_modelmeta().custom_metadata_map  # it may be damaged, too
    except Exception as error:
        # Damaged bytes make onnxruntime raise nearly anything, UnicodeDecodeError included.
        reason = str(error).partition("\n")[0]
        if newer := NEWER.search(reason):
            raise ModelFileError(
                "the file is made for a newer onnxruntime than the one that is installed: upgrade "
                f"it (version {onnxruntime.__version__}: {newer[0]})"
            ) from None
        raise ModelFileError(f"the file is damaged or is no ONNX model: {reason}") from None
    return session


def run(
    session: onnxruntime.InferenceSession, outputs: Sequence[str], inputs: Mapping[str, np.ndarray]
) -> list[np.ndarray]:
    """Outputs of a session, by their names. Raises MemoryError where memory runs out inside it."""
    try:
        return [np.asarray(output) for output in session.run(outputs, inputs)]
    except Exception as error:
        if OUT_OF_MEMORY.search(str(error)):
            raise MemoryError("memory ran out inside onnxruntime") from None
        raise


def session_options() -> onnxruntime.SessionOptions:
    """How model files are run: each mesh on one thread, they are too small to share."""
    options = onnxruntime.SessionOptions()
    options.intra_op_num_threads = 1
    options.log_severity_level = 4  # errors reach the caller as exceptions, nothing goes to stderr
    # The arena would keep what the largest mesh took; without it, a mesh takes as long.
    options.enable_cpu_mem_arena = False
    options.enable_mem_pattern = False  # which would take all of it at once, anew for each mesh
    return options


def is_whole(session: onnxruntime.InferenceSession) -> bool:
    """Whether a file is a whole pipeline."""
    return [value.name for value in session.get_inputs()] == ["vertices", "faces"]


class GraphInputs(NamedTuple):
    """Inputs of a graph by name, and the mesh that they are of."""

    mesh: Mesh
    arrays: dict[str, NDArray]


def graph_inputs(
    session: onnxruntime.InferenceSession, mesh: Mesh, config: NetworkConfig
) -> GraphInputs:
    """What the graph of a model file or of a whole pipeline takes of a prepared mesh."""
    if is_whole(session):
        arrays = whole_inputs(mesh)
        return GraphInputs(as_given(arrays), arrays)
    return GraphInputs(mesh, collate([mesh_inputs(mesh, config)]))
