"""The whole pipeline in one ONNX file: from vertices and faces of a prepared mesh to scores.

`pipeline` joins the topology stage, written as a graph, to the graph of a model file, and `parity`
compares the result with the kernels. `halfedges`, `geometry`, `descriptors`,
`integral_invariants`, `pooling` and `surface` mirror the modules of `model.topology`: what they
choose and count is the same, to the last index. `arrays` is what they are written with. onnx is
needed, torch is not.
"""

from meshconv3d.export.whole.pipeline import export_whole, make_whole

__all__ = ["export_whole", "make_whole"]
