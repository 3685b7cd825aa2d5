"""From a trained checkpoint to one self-contained `.onnx` file, and back to what it says.

`graph` is the network as it is exported, `translation` what its operators become in ONNX,
`onnx_file` writes it, `parity` compares it with torch. `metadata` is what the file says of itself,
`operators` gives onnxruntime our own ones, `runtime` is onnxruntime as this project loads it. Only
these three are used at run time: they need neither torch nor onnx.
"""
