"""The inputs of the graph in NumPy, as docs/onnx-file.md has them, are those of the package."""

import numpy as np
import pytest

from examples.graph_inputs import graph_inputs
from meshconv3d.export.runtime import run
from meshconv3d.model.loading import load_mesh
from meshconv3d.model.mesh import Mesh
from meshconv3d.model.preparation import prepare
from meshconv3d.model.samples import sample_paths
from meshconv3d.model.topology.inputs import collate, mesh_inputs
from meshconv3d.service.models import ModelFile
from tests.meshes import icosphere, moebius, sheet

SAMPLES = [load_mesh(path) for path in sample_paths().values()][:4]


@pytest.mark.parametrize("name", ["objects", "shrec11"])
@pytest.mark.parametrize("mesh", [*SAMPLES, sheet(), icosphere(), moebius()])
def test_the_inputs_are_those_of_the_package(name: str, mesh: Mesh) -> None:
    model = ModelFile.read(name).open()
    config = model.card.config
    prepared, _ = prepare(mesh, config.face_budget)
    ours = graph_inputs(
        prepared.vertices, prepared.faces, config.absolute_offsets, config.integral_invariants
    )
    theirs = collate([mesh_inputs(prepared, config)])
    assert ours.keys() == theirs.keys()
    for input_name, array in theirs.items():
        if array.dtype == np.int32:
            np.testing.assert_array_equal(ours[input_name], array, err_msg=input_name)
        assert ours[input_name].dtype == array.dtype
    # The square root of what is all but zero: the spread of a plane across itself.
    np.testing.assert_allclose(ours["terms"], theirs["terms"], atol=1e-4)
    one, other = (run(model.session, ["scores"], inputs)[0] for inputs in (ours, theirs))
    np.testing.assert_allclose(one, other, atol=1e-3)
