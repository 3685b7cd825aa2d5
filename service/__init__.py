"""Runtime: classify meshes with a model file, from Python, the command line or HTTP.

`classifier` runs both stages, `models` opens model files, `records` makes the public JSON of
results. `workers` runs classifiers in processes, which a file may crash. `cli` is the command line,
`batch` its runs over many files, `http` the service. None of these modules imports torch or onnx.
"""
