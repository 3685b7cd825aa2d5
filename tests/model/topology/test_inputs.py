"""From meshes to the named arrays of one ragged batch."""

import numpy as np
import pytest

from meshconv3d.model.mesh import Mesh
from meshconv3d.model.topology.inputs import collate, input_names, mesh_inputs
from tests.meshes import cube, sheet, together, torus
from tests.networks import topology_of

MESHES = [torus(), cube(), Mesh(np.eye(3), [[0, 1, 2]]), sheet(9, 7), together(cube(), sheet(3, 3))]


def test_one_mesh_is_its_own_batch(config):
    inputs = mesh_inputs(torus(), config)
    arrays = collate([inputs])
    assert list(arrays) == input_names(config)
    assert arrays["terms"].shape == (500, 21)
    assert (arrays["terms"] == inputs.terms).all()
    for level in range(3):
        assert (arrays[f"patches_{level}"] == topology_of(inputs).patches[level]).all()
        assert (arrays[f"pools_{level}"] == topology_of(inputs).pools[level]).all()
    last = topology_of(inputs).face_counts[-1]
    assert arrays["readout"].tolist() == [list(range(1, last + 1))]


def test_a_batch_is_its_meshes_one_after_the_other(config):
    batch = [mesh_inputs(mesh, config) for mesh in MESHES]
    arrays = collate(batch)
    counts = np.array([topology_of(inputs).face_counts for inputs in batch])
    starts = np.cumsum(counts, axis=0) - counts

    def check(name, table_level, parts):
        row = 0
        for i, part in enumerate(parts):
            block = arrays[name][row : row + len(part)]
            # Null stays null, a face moves by where its mesh begins, and padding is null.
            expected = np.where(part > 0, part + starts[i, table_level], 0)
            assert (block[:, : part.shape[1]] == expected).all()
            assert (block[:, part.shape[1] :] == 0).all()
            row += len(part)
        assert row == len(arrays[name])
        assert arrays[name].dtype == np.int32

    for level in range(3):
        check(f"patches_{level}", level, [topology_of(b).patches[level] for b in batch])
        check(f"pools_{level}", level, [topology_of(b).pools[level] for b in batch])
    check("readout", 3, [np.arange(1, last + 1)[None] for last in counts[:, 3]])
    terms = np.concatenate([inputs.terms for inputs in batch])
    assert (arrays["terms"] == terms).all()


@pytest.mark.parametrize("mesh", MESHES)
def test_inputs_follow_the_configuration(config, mesh):
    inputs = mesh_inputs(mesh, config)
    assert inputs.terms.shape == (len(mesh.faces), 21)
    assert topology_of(inputs).face_counts[0] == len(mesh.faces)
    assert all(patches.shape[1] == config.patch_size for patches in topology_of(inputs).patches)
