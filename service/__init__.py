"""The runtime: classify meshes with a model file, from Python, the command line or HTTP.

`classifier` runs both stages, `models` finds and opens model files, `records` is the one form in
which results leave. `workers` does the same in processes of their own, which a file may break.
`cli` and `http` are two doors to the same rooms. Nothing here, nor anything that it imports, loads
torch or onnx.
"""
