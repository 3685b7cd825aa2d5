"""From a trained checkpoint to one self-contained `.onnx` file.

`onnx_file` folds and traces the network and writes the file, `translation` maps its operators to
ONNX, `parity` compares the file with torch, `cli` has the commands. `whole` adds the topology stage
to the graph of a model file. At run time only two modules are used, without torch and onnx:
`metadata`, the card in a file; `runtime`, sessions.
"""
