"""From a trained checkpoint to one self-contained `.onnx` file, and back to what it says.

`graph` is the network as it is exported, `onnx_file` writes it, `parity` compares it with torch,
`metadata` is what the file says of itself. Only `metadata` is read at run time: it needs neither
torch nor onnx.
"""
