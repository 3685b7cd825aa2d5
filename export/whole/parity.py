"""Comparison of a whole pipeline with the kernels and with the model file that it is made of."""

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from meshconv3d.export.comparison import OUTPUTS, TOLERANCE, ParityError, compare_outputs
from meshconv3d.export.runtime import onnxruntime as ort
from meshconv3d.export.runtime import open_session
from meshconv3d.model.config import NetworkConfig
from meshconv3d.model.mesh import Mesh
from meshconv3d.model.topology.inputs import (
    as_given,
    collate,
    input_names,
    mesh_inputs,
    whole_inputs,
)


def check_topology(topology: bytes, config: NetworkConfig, meshes: Mapping[str, Mesh]) -> None:
    """Run the topology stage on prepared meshes, by name.

    Patches and pooled faces must be those of the kernels. Raises ParityError.
    """
    session = open_session(topology)
    failures = []
    for name, mesh in meshes.items():
        inputs = whole_inputs(mesh)
        expected = collate([mesh_inputs(as_given(inputs), config)])
        found = run_by_name(session, inputs, input_names(config))
        failures += [f"{name}: {other}" for other in other_indices(found, expected)]
    if failures:
        raise ParityError(
            "the file chooses other faces than the kernels:\n  " + "\n  ".join(failures)
        )


def check_outputs(
    whole: bytes, model: bytes, config: NetworkConfig, meshes: Mapping[str, Mesh]
) -> dict[str, float | int | str]:
    """Run the whole pipeline and its model file on prepared meshes, by name.

    Returns the largest relative difference of each output, and what it was measured on. Raises
    ParityError where one is above the tolerance.
    """
    sessions = [open_session(content) for content in (whole, model)]
    found: dict[str, Mapping[str, NDArray]] = {}
    expected: dict[str, Mapping[str, NDArray]] = {}
    for name, mesh in meshes.items():
        inputs = whole_inputs(mesh)
        found[name] = run_by_name(sessions[0], inputs, OUTPUTS)
        arrays = collate([mesh_inputs(as_given(inputs), config)])
        expected[name] = run_by_name(sessions[1], arrays, OUTPUTS)
    return {
        **compare_outputs(found, expected, "the model"),
        "meshes": len(meshes),
        "tolerance": TOLERANCE,
        "onnxruntime": ort.__version__,
    }


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
