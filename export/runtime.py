"""onnxruntime, told before it is loaded that nothing phones home.

Official builds of onnxruntime send events about every process, model and error, and keep an
identifier of the device in the home folder. This variable, read once as the library is loaded,
is the only switch that prevents both. Import onnxruntime from here and nowhere else.
"""

import os

os.environ["ORT_DISABLE_TELEMETRY"] = "1"

import onnxruntime

__all__ = ["onnxruntime"]
