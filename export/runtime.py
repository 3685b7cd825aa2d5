"""onnxruntime without telemetry, and sessions on model files.

Official builds of onnxruntime send events about every process, model and error, and keep an
identifier of the device in the home folder. ORT_DISABLE_TELEMETRY, which is read as the library is
loaded, is the only switch against both. All other modules import onnxruntime from this one.
"""

import os
import re
from collections.abc import Mapping, Sequence

import numpy as np

os.environ["ORT_DISABLE_TELEMETRY"] = "1"

import onnxruntime

from meshconv3d.export.metadata import ModelFileError
from meshconv3d.export.operators import DOMAIN, operator_library

__all__ = ["onnxruntime", "open_session", "run", "session_options"]

# onnxruntime has no types for these errors: words of their messages.
OUT_OF_MEMORY = re.compile("bad_alloc|allocate memory")
NEWER = re.compile(
    "(Unsupported model IR version|Current official support for|Could not find an implementation).*"
)

# The key of an entry that names the file of a tensor's values.
EXTERNAL_DATA = b"\n\x08location\x12"


def open_session(content: bytes) -> onnxruntime.InferenceSession:
    """A session on the bytes of a model file; `run` is thread-safe.

    Raises ModelFileError for a file that is damaged, no model, not whole, made for a newer
    onnxruntime, or in need of operators that are not installed.
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
    options = session_options(content)
    try:
        # Without fallback: it would print to stdout and then fail in the same way.
        session = onnxruntime.InferenceSession(
            content, options, providers=["CPUExecutionProvider"], enable_fallback=0
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


def session_options(content: bytes) -> onnxruntime.SessionOptions:
    """How the bytes of a model file are run: each mesh on one thread, they are too small to share.

    Raises ModelFileError where it needs operators that are not installed.
    """
    options = onnxruntime.SessionOptions()
    options.intra_op_num_threads = 1
    options.log_severity_level = 4  # errors reach the caller as exceptions, nothing goes to stderr
    # The arena would keep what the largest mesh took; without it, a mesh takes as long.
    options.enable_cpu_mem_arena = False
    options.enable_mem_pattern = False  # which would take all of it at once, anew for each mesh
    # What a file needs can only be asked once it is open, which takes what it needs.
    if DOMAIN.encode() in content:
        options.register_custom_ops_library(operator_library())
    return options
