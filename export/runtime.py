"""onnxruntime, told before it is loaded that nothing phones home, and how a model is opened.

Official builds of onnxruntime send events about every process, model and error, and keep an
identifier of the device in the home folder. This variable, read once as the library is loaded,
is the only switch that prevents both. Import onnxruntime from here and nowhere else.
"""

import os

os.environ["ORT_DISABLE_TELEMETRY"] = "1"

import onnxruntime

from meshconv3d.export.metadata import ModelFileError
from meshconv3d.export.operators import DOMAIN, operator_library

__all__ = ["onnxruntime", "open_session", "session_options"]


def open_session(content: bytes) -> onnxruntime.InferenceSession:
    """A session on the bytes of a model file; `run` is thread-safe.

    Raises ModelFileError for what is damaged, no model, or in want of operators that are not
    installed.
    """
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
        raise ModelFileError(f"the file is damaged or is no ONNX model: {reason}") from None
    return session


def session_options(content: bytes) -> onnxruntime.SessionOptions:
    """How the bytes of a model file are run: each mesh on one thread, they are too small to share.

    Raises ModelFileError where it needs operators that are not installed.
    """
    options = onnxruntime.SessionOptions()
    options.intra_op_num_threads = 1
    options.log_severity_level = 3  # errors reach the caller as exceptions; no warnings on stderr
    # What a file needs can only be asked once it is open, which takes what it needs.
    if DOMAIN.encode() in content:
        options.register_custom_ops_library(operator_library())
    return options
