"""Comparison of a whole pipeline with the kernels and with the model file that it is made of."""

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from meshconv3d.export.comparison import OUTPUTS, TOLERANCE, ParityError, compare_outputs
from meshconv3d.export.runtime import onnxruntime as ort
from meshconv3d.export.runtime import open_session
from meshconv3d.model.config import NetworkConfig
from meshconv3d.model.mesh import Mesh
from meshconv3d.model.topology.inputs import collate, input_names, mesh_inputs


def check_whole(
    whole: bytes, topology: bytes, model: bytes, config: NetworkConfig, meshes: Mapping[str, Mesh]
) -> dict[str, float | int | str]:
    """Run the whole pipeline, its topology stage and the model on prepared meshes, by name.

    Patches and pooled faces must be those of the kernels, and outputs within the tolerance of the
    model's. Returns the largest relative difference of each output, and what it was measured on.
    Raises ParityError.
    """
    sessions = [open_session(content) for content in (whole, topology, model)]
    found: dict[str, Mapping[str, NDArray]] = {}
    expected: dict[str, Mapping[str, NDArray]] = {}
    failures = []
    for name, mesh in meshes.items():
        inputs = whole_inputs(mesh)
        arrays = collate([mesh_inputs(as_given(inputs), config)])
        ours = run_by_name(sessions[1], inputs, input_names(config))
        failures += [f"{name}: {other}" for other in other_indices(ours, arrays)]
        found[name] = run_by_name(sessions[0], inputs, OUTPUTS)
        expected[name] = run_by_name(sessions[2], arrays, OUTPUTS)
    if failures:
        raise ParityError(
            "the file chooses other faces than the kernels:\n  " + "\n  ".join(failures)
        )
    return {
        **compare_outputs(found, expected, "the model"),
        "meshes": len(meshes),
        "tolerance": TOLERANCE,
        "onnxruntime": ort.__version__,
    }


def whole_inputs(mesh: Mesh) -> dict[str, NDArray]:
    """The inputs of the whole pipeline: vertices, V x 3 float32; faces, F x 3 int64."""
    return {
        "vertices": mesh.vertices.astype(np.float32),
        "faces": mesh.faces.astype(np.int64),
    }


def as_given(inputs: Mapping[str, NDArray]) -> Mesh:
    """The mesh that these inputs are: its vertices are rounded to float32."""
    return Mesh(inputs["vertices"], inputs["faces"])


def run_by_name(
    session: ort.InferenceSession, inputs: Mapping[str, NDArray], names: tuple[str, ...] | list[str]
) -> dict[str, NDArray]:
    """All outputs of a session, in the order of its graph, by these names."""
    return dict(zip(names, map(np.asarray, session.run(None, dict(inputs))), strict=True))


def other_indices(found: Mapping[str, NDArray], expected: Mapping[str, NDArray]) -> list[str]:
    """Names of the network's inputs, but for its terms, that are not the same."""
    return [
        name
        for name, array in expected.items()
        if name != "terms" and not np.array_equal(found[name], array)
    ]
