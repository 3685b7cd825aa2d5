"""What faces add to a score: nothing is lost on the way back to the file."""

import numpy as np
import pytest

from meshconv3d.model.attribution import contributions, onto_file
from meshconv3d.model.config import NetworkConfig
from meshconv3d.model.mesh import Mesh
from meshconv3d.model.preparation import face_areas, prepare_placed
from meshconv3d.model.topology import Surface, Topology
from meshconv3d.model.topology.inputs import mesh_inputs
from tests.meshes import cube, icosphere, sheet, together, torus
from tests.networks import topology_of

# With as many faces as the budget, more, fewer, borders, and several parts.
MESHES = {
    "torus": torus(),
    "ball": icosphere(3),
    "cube": cube(),
    "sheet": sheet(),
    "parts": together(cube(), torus().moved(torus().vertices + 4)),
}


def shares_of(mesh: Mesh, evidence: np.ndarray, config: NetworkConfig) -> np.ndarray:
    inputs = mesh_inputs(mesh, config)
    return contributions(evidence, topology_of(inputs), inputs.surface)


@pytest.mark.parametrize("name", MESHES)
def test_the_sum_is_kept_down_to_the_file(name: str, config: NetworkConfig) -> None:
    mesh = MESHES[name]
    prepared, _, placement = prepare_placed(mesh, config.face_budget)
    inputs = mesh_inputs(prepared, config)
    evidence = np.random.default_rng(0).normal(size=topology_of(inputs).face_counts[-1])
    shares = contributions(evidence, topology_of(inputs), inputs.surface)
    assert shares.shape == (len(prepared.faces),)
    assert shares.sum() == pytest.approx(evidence.mean(), abs=1e-12)
    placed = prepared.moved(placement.into_file(prepared.vertices))
    added = onto_file(shares, placed, mesh)
    assert added.shape == (len(mesh.faces),)
    assert added.sum() == pytest.approx(evidence.mean(), abs=1e-12)


def test_like_evidence_reaches_every_face(config: NetworkConfig) -> None:
    mesh, _, _ = prepare_placed(torus(), config.face_budget)
    count = topology_of(mesh_inputs(mesh, config)).face_counts[-1]
    assert (shares_of(mesh, np.ones(count), config) > 0).all()


def test_a_pooled_face_shares_among_those_that_it_gathered() -> None:
    """Six faces in a row; one gathers two of them, the other three, and one is left out."""
    twin = np.full(18, -1, np.int32)
    for f in range(5):
        twin[3 * f + 1], twin[3 * f + 3] = 3 * f + 3, 3 * f + 1
    pool = np.array([[1, 2, 0], [3, 4, 5]], np.int32)
    topology = Topology((np.zeros((6, 1), np.int32),), (pool,))
    surface = Surface(np.zeros((6, 3), np.int32), twin, np.ones(18))
    shares = contributions(np.array([4.0, 12.0]), topology, surface)
    # The sixth has half of what its only neighbour had.
    assert shares == pytest.approx([1, 1, 2, 2, 1, 1])


def test_an_unchanged_mesh_keeps_its_faces(config: NetworkConfig) -> None:
    mesh = torus()
    prepared, report, placement = prepare_placed(mesh, config.face_budget)
    assert report.resampled == "none"
    shares = np.random.default_rng(0).normal(size=500)
    placed = prepared.moved(placement.into_file(prepared.vertices))
    added = onto_file(shares, placed, mesh)
    assert sorted(added) == pytest.approx(sorted(shares))
    near = placed.vertices[placed.faces].mean(axis=1), mesh.vertices[mesh.faces].mean(axis=1)
    for f in (0, 99, 499):
        g = np.linalg.norm(near[0] - near[1][f], axis=1).argmin()
        assert added[f] == pytest.approx(shares[g])


def test_the_order_of_the_file_does_not_matter(config: NetworkConfig) -> None:
    mesh = icosphere(3)
    order = np.random.default_rng(0).permutation(len(mesh.faces))
    shares = np.random.default_rng(1).normal(size=config.face_budget)
    found = []
    for one in (mesh, Mesh(mesh.vertices, mesh.faces[order])):
        prepared, _, placement = prepare_placed(one, config.face_budget)
        placed = prepared.moved(placement.into_file(prepared.vertices))
        found.append(onto_file(shares[: len(prepared.faces)], placed, one))
    assert found[1] == pytest.approx(found[0][order], abs=1e-12)


def test_duplicates_share_and_lines_have_nothing() -> None:
    mesh = cube()
    doubled = Mesh(mesh.vertices, [*mesh.faces, mesh.faces[0], [0, 0, 1]])
    added = onto_file(np.arange(12.0) + 1, mesh, doubled)
    assert added[0] == added[12] == pytest.approx(0.5)
    assert added[1:12] == pytest.approx(np.arange(2, 13))
    assert added[13] == pytest.approx(0, abs=1e-12)


def test_a_large_face_has_what_lies_in_it() -> None:
    """The cube's faces are each cut in two; together the halves add what the whole does."""
    mesh = cube()
    corners = mesh.vertices[mesh.faces]
    middle = (corners[:, 0] + corners[:, 1]) / 2
    halves = np.concatenate(
        [
            np.stack([corners[:, 0], middle, corners[:, 2]], axis=1),
            np.stack([middle, corners[:, 1], corners[:, 2]], axis=1),
        ]
    )
    cut = Mesh(halves.reshape(-1, 3), np.arange(72).reshape(-1, 3))
    shares = np.arange(24.0)
    assert onto_file(shares, cut, mesh) == pytest.approx(shares[:12] + shares[12:])


def test_a_placement_leads_back_into_the_file(config: NetworkConfig) -> None:
    mesh = torus().moved(torus().vertices * 3 + [100, -7, 1e4])
    prepared, _, placement = prepare_placed(mesh, config.face_budget)
    back = placement.into_file(prepared.vertices)
    assert back.min(axis=0) == pytest.approx(mesh.vertices.min(axis=0), abs=1e-4)
    assert back.max(axis=0) == pytest.approx(mesh.vertices.max(axis=0), abs=1e-4)
    assert face_areas(back, prepared.faces).sum() == pytest.approx(
        face_areas(mesh.vertices, mesh.faces).sum(), rel=1e-4
    )
