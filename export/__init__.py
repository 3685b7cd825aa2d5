"""From a trained checkpoint to one self-contained `.onnx` file, and back to what it says.

`graph` is the network as it is exported, `onnx_file` writes it, `parity` compares it with torch,
`metadata` is what the file says of itself, `runtime` is onnxruntime as this project loads it. Only
these two are used at run time: they need neither torch nor onnx.
"""
