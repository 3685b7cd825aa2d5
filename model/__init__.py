"""Meshes, their preparation and topology, and the network that is trained on them.

`import meshconv3d.model` loads neither torch nor onnx. The network is in `model.nn`, training in
`model.training`: both need torch. All other modules are NumPy and numba, and are used in serving.

Legend of dimension letters, used in every docstring of the project:

    B   meshes in a batch
    V   vertices
    F   faces; F_l at pooling level l (F_0 of the prepared mesh), N the faces of a whole batch
    H   half-edges, H = 3 F; half-edge h = 3 f + s is side s of face f
    K   patch size, the face itself included
    W   width of a pooling index: the most faces one pooled face gathers
    T   pooling target, a face count
    L   levels (blocks) of the network
    D   descriptor terms, each a 3-vector
    M   integral invariants of a face
    E   numbers that the descriptors read of a face: 3 D, or 3 D + M
    C   channels
    A   numbers of an embedding
    N_c classes

Face tables that are indexed by the network carry a null row: row 0 is zeros and face f is
row f + 1. Index arrays into such tables are int32, with 0 for "no face there".
"""
